"""A campaign that is divided among clusters: which part each executes, and how they are named."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from robovast.base.errors import ExitCode, InputError
from robovast.kubeapi.names import CAMPAIGN_NAME_LIMIT
from robovast.kubeapi.submission import SubmitOptions
from robovast.model.document import Document
from robovast.model.expansion import part_pattern, patterns_of
from robovast_cli.kube.api import Kubernetes
from robovast_cli.kube.status import CampaignState

_SEVERITY = (
    ExitCode.BAD_INPUT,
    ExitCode.CANNOT_RUN,
    ExitCode.TEST_FAILED,
    ExitCode.RUN_ERRORED,
)
"""Exit codes of campaigns, the one that hides all others first."""


@dataclass(frozen=True)
class Part:
    """A campaign in its cluster: all that is executed, or a part of it."""

    kube: Kubernetes
    campaign: CampaignState


def divided(
    document: Document, options: SubmitOptions, contexts: Sequence[str]
) -> list[SubmitOptions]:
    """The options of each part: every configuration is in one of them.

    Raises:
        InputError: a search has no configurations to divide, or a context is named twice.
    """
    if len(contexts) < 2:
        return [options]
    check_distinct(contexts)
    if document.vast.search is not None:
        raise InputError(
            f"{document.source.file}: a search proposes its configurations one batch after the "
            "other, so that it cannot be divided: name one `--context`."
        )
    return [
        replace(options, select=[*patterns_of(options.select), part_pattern(n, len(contexts))])
        for n in range(1, len(contexts) + 1)
    ]


def check_distinct(contexts: Sequence[str]) -> None:
    """Refuse a context that is named twice.

    Raises:
        InputError: one is.
    """
    if len(set(contexts)) < len(contexts):
        raise InputError("`--context` names one context twice: name each cluster once.")


def part_name(name: str, number: int, of: int) -> str:
    """Name of a part's Campaign: that of the campaign when there is no other."""
    if of == 1:
        return name
    words, _, unique = name.rpartition("-")  # what is cut off is not what makes it unique
    mark = f"{unique}-{number}of{of}"
    return f"{words[: CAMPAIGN_NAME_LIMIT - len(mark) - 1].rstrip('-')}-{mark}".strip("-")


def parts_named(name: str, of: int, known: Iterable[CampaignState]) -> Iterator[CampaignState]:
    """The parts of a divided campaign among those of a cluster."""
    names = {part_name(name, number, of) for number in range(1, of + 1)}
    return (campaign for campaign in known if campaign.name in names)


def worst(codes: Iterable[ExitCode]) -> ExitCode:
    """The exit code of a campaign by those of its parts."""
    found = set(codes)
    return next((code for code in _SEVERITY if code in found), ExitCode.OK)

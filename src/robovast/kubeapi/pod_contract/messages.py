"""Termination messages, which the operator reads when a container has ended.

Each is written and read by its class here. Anybody may have written one: an invalid
message counts as none.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.alias_generators import to_camel

from robovast.base.ranges import format_ranges, spans, truncate
from robovast.campaign.decisions import DECISIONS_LIMIT
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.model.packs import SETS_LIMIT

LIMIT = 4096
"""Longest message that Kubernetes keeps [byte]."""
VERDICTS_LIMIT = 800
"""Longest text of one kind of runs in `Verdicts` [byte]."""
SUMMARY_LIMIT = 1500
"""Longest text of one kind of runs in `Summary` [byte]."""
ERROR_LIMIT = 1500
"""[byte]"""
BAD_TOLD = 3
"""Most bad runs whose reasons are in `Verdicts`."""
BAD_LIMIT = 250
"""Longest text of such a run [byte]."""
BLOCKS_LIMIT = 100
"""Most blocks in `Proposed`."""
BREAKS_LIMIT = 400
"""[characters]"""
TEXT_LIMIT = 250
"""Longest text of a kind in `Proposed` [characters]."""

Count = Annotated[int, Field(ge=0, lt=2**31)]


class TerminationMessage(BaseModel):
    """The termination message of a container."""

    model_config = ConfigDict(
        alias_generator=to_camel,
        populate_by_name=True,
        extra="ignore",
        frozen=True,
        strict=True,
        defer_build=True,
    )

    @classmethod
    def read(cls, said: str) -> Self | None:
        """Parse a message; return None if the text is none."""
        try:
            return cls.model_validate_json(said)
        except ValidationError:
            return None

    @property
    def text(self) -> str:
        """The text, within Kubernetes' limit."""
        return json.dumps(self.model_dump(by_alias=True, exclude_none=True))

    def write(self, path: Path) -> None:
        """Write the message if Kubernetes has created the container's file for it."""
        if path.exists():
            _rewrite(path, self.text)


class BadRun(BaseModel):
    """A run that did not pass, and why."""

    model_config = ConfigDict(extra="ignore", frozen=True, defer_build=True)

    run: Annotated[str, Field(max_length=BAD_LIMIT)]
    """`<variant>/<number>`."""
    verdict: Literal["failed", "errored"]
    reason: Annotated[str, Field(max_length=BAD_LIMIT)]

    @classmethod
    def of(cls, record: RunRecord) -> Self:
        """The message about a failed or errored run."""
        run = shortened(f"{record.variant}/{record.run}", BAD_LIMIT)
        verdict: Literal["failed", "errored"] = (
            "failed" if record.verdict is Verdict.FAILED else "errored"
        )
        return cls(run=run, verdict=verdict, reason=shortened(record.reason, BAD_LIMIT))


class Verdicts(TerminationMessage):
    """Message of `agent`: ids of the pod's stored runs; the counts are always exact."""

    passed: str
    failed: str
    errored: str
    counts: tuple[Count, Count, Count] | None = None
    """Counts of runs; older agents do not write them."""
    truncated: bool | None = None
    """Whether there was no room for some ids."""
    not_needed: Count | None = None
    """How many other runs of the pod need not be executed, since these have decided."""
    executed: Count | None = None
    """How many runs this very pod has executed."""
    seconds: Annotated[float, Field(ge=0, lt=2**31)] | None = None
    """How long these took together."""
    bad: Annotated[tuple[BadRun, ...], Field(max_length=BAD_TOLD)] | None = None
    """The first bad runs that it has executed."""

    @classmethod
    def of(
        cls,
        verdicts: Mapping[int, Verdict],
        not_needed: int = 0,
        took: Collection[float] = (),
        bad: Collection[BadRun] = (),
    ) -> Self:
        """The message of a pod.

        Args:
            verdicts: of its runs, by id.
            not_needed: how many others are not.
            took: how long each run took that it has executed itself [s].
            bad: the first bad runs; left out where there is no room, which an error may need.
        """
        kinds = (Verdict.PASSED, Verdict.FAILED, Verdict.ERRORED)
        ids = [[id_ for id_, found in verdicts.items() if found is kind] for kind in kinds]
        texts, cut = zip(*(id_ranges(some, VERDICTS_LIMIT) for some in ids), strict=True)
        passed, failed, errored = texts
        made = cls(
            passed=passed,
            failed=failed,
            errored=errored,
            counts=(len(ids[0]), len(ids[1]), len(ids[2])),
            truncated=any(cut) or None,
            not_needed=not_needed or None,
            executed=len(took) or None,
            seconds=round(sum(took), 3) if took else None,
            bad=tuple(bad) or None,
        )
        fits = len(made.text) <= LIMIT - ERROR_LIMIT - len('"error": , ')
        return made if fits else made.model_copy(update={"bad": None})


class Composed(TerminationMessage):
    """Message of `compose`."""

    counts: tuple[Count, ...] = Field(min_length=1)
    """Variants of each entry, in the document's order."""
    breaks: str = ""
    """`PlanSpec.breaks`."""
    digest: str | None = None
    """`CampaignPlan.composed`; older Jobs have none."""
    error: str | None = None
    """The cause of a failure; the other fields are invalid then."""


class Proposed(TerminationMessage):
    """Message of `propose`: how far a search is, and the runs that it wants next.

    It fits into Kubernetes' limit, whatever its fields hold.
    """

    blocks: tuple[tuple[Count, Count, Count, Count], ...] = Field(max_length=BLOCKS_LIMIT)
    """The next blocks of the plan: first variant, variants, first run, runs of each."""
    variants: Annotated[int, Field(ge=0, le=SETS_LIMIT)] = 0
    """How many variants are new."""
    breaks: Annotated[str, Field(max_length=BREAKS_LIMIT)] = ""
    """Which of these cannot share a pack with the one before, from 0, as ranges."""
    digest: Annotated[str, Field(pattern=r"^([0-9a-f]{64})?$")] = ""
    """`CampaignPlan.composed`: all variants, with the new ones."""
    awaited: Count | None = None
    """`PlanSpec.awaited`: how many blocks end before it is asked again."""
    batch: Count = 0
    """How many batches are scored."""
    evaluated: Count = 0
    """How many sets have a score."""
    best: Annotated[str, Field(max_length=TEXT_LIMIT)] = ""
    criteria: Annotated[str, Field(max_length=TEXT_LIMIT)] = ""
    stop: Annotated[str, Field(max_length=TEXT_LIMIT)] = ""
    """Why the search has ended, in one word; empty while it has not."""
    stop_reason: Annotated[str, Field(max_length=TEXT_LIMIT)] = ""
    error: str | None = None
    """The cause of a failure; the other fields are invalid then."""


class Repeat(BaseModel):
    """The list of all bad runs, for repeating them."""

    model_config = ConfigDict(defer_build=True)

    list: str
    """Name of the list in the bucket."""
    sizes: str
    """Sizes of the groups in which pods repeat them."""


class Summary(TerminationMessage):
    """Message of `finish`: the counts of a campaign, and some ids of its bad runs."""

    total: Count
    passed: Count
    failed: Count
    errored: Count
    stored: Count | None = None
    not_needed: Count | None = None
    """Runs that were not executed, since others have decided about their configuration."""
    decisions: Annotated[str, Field(max_length=DECISIONS_LIMIT)] | None = None
    """What is decided about configurations, for people."""
    failed_runs: str = ""
    errored_runs: str = ""
    truncated: bool = False
    """Whether there was no room for some ids."""
    failing: tuple[str, ...] = ()
    """The first bad runs, `<variant>/<number>`."""
    repeat: Repeat | None = None

    def fitting(self) -> Self:
        """The same within Kubernetes' limit: texts that are only for people are cut."""
        fits = self
        for name, nothing in (("failing", ()), ("errored_runs", ""), ("failed_runs", "")):
            if len(fits.text) <= LIMIT:
                break
            fits = fits.model_copy(update={name: nothing, "truncated": True})
        return fits


class Processed(TerminationMessage):
    """Message of `process`."""

    runs: int
    worked: int
    """Runs that were processed."""
    stored: int
    """Files that are new in the bucket."""


class Shared(TerminationMessage):
    """Message of `share`."""

    archive: str
    size: int
    """[byte]"""


def id_ranges(ids: Collection[int], limit: int) -> tuple[str, bool]:
    """Ids as ranges, as many as there is room for, and whether some are missing."""
    return truncate(format_ranges(spans(ids)), limit)


def write_error(path: Path, error: str, *, as_json: bool) -> None:
    """Write an error into the termination message.

    Args:
        path: of the message.
        error: what went wrong.
        as_json: as the key `error` beside what the message says already.
    """
    if not path.exists():
        return
    said = path.read_text(encoding="utf-8")
    text = shortened(error, ERROR_LIMIT)
    _rewrite(path, json.dumps({**json.loads(said or "{}"), "error": text}) if as_json else text)


def _rewrite(path: Path, text: str) -> None:
    """Overwrite a file in place, without freeing its space first: the disk may be full."""
    with path.open("r+b") as file:
        file.write(text.encode())
        file.truncate()


def error_in(said: str) -> str:
    """The error in a termination message: the key `error`, or the whole text if it is no JSON."""
    try:
        return str(json.loads(said)["error"])
    except (ValueError, KeyError, TypeError, RecursionError):
        return said.strip()


def shortened(text: str, limit: int) -> str:
    """Shorten a text to a number of bytes in JSON."""
    while len(json.dumps(text)) > limit:
        text = text[: len(text) * 3 // 4] + "…"
    return text

"""The scripting API: execute campaigns, and open executed ones; exported by `robovast`."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robovast.base.errors import InputError
from robovast.campaign.configurations import read_variants
from robovast.campaign.decisions import describe_decision
from robovast.campaign.discovery import find_campaigns
from robovast.campaign.layout import Layout
from robovast.campaign.run_record import RunRecord, read_run_record, result_without_record
from robovast.campaign.verdict import Verdict

if TYPE_CHECKING:
    from robovast.analysis.postprocessing.events import Failure, PostprocessingSummary
    from robovast.analysis.postprocessing.events import Options as PostprocessingOptions
    from robovast.analysis.tables.query import Answer
    from robovast.execution.local import LocalOptions
    from robovast.execution.local.pack_queue import Decided
    from robovast.model.document import Document
    from robovast.model.expansion import Variant
    from robovast.model.plan import Run

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class StoredRun:
    """A stored run of a campaign."""

    folder: Path
    variant: str
    """Name of its variant."""
    number: int
    """Number of the run within its variant, from 0."""
    verdict: Verdict
    reason: str
    """Why it did not pass; empty if it did."""
    duration: float | None
    """[s]"""
    parameters: Mapping[str, Any]
    """Scenario parameters that differ from the scenario's defaults."""


@dataclass(frozen=True)
class Campaign:
    """A campaign's folder."""

    folder: Path

    def variants(self) -> list[Variant]:
        """The planned variants, in order.

        Raises:
            InputError: the campaign has no list of variants, as with other tools.
        """
        return read_variants(Layout(self.folder))

    def runs(self) -> list[StoredRun]:
        """All stored runs, including those of other tools, by variant and number."""
        parameters: dict[str, Mapping[str, Any]] = {}
        with suppress(InputError):
            parameters = {variant.name: variant.parameters for variant in self.variants()}
        folders = Layout(self.folder).run_folders()
        return [_stored_run(folder, parameters.get(folder.parent.name, {})) for folder in folders]

    def postprocess(self, options: PostprocessingOptions | None = None) -> PostprocessingSummary:
        """Update the tables, metadata and graph of the campaign.

        Args:
            options: options of `vast results postprocess`; None means its defaults.

            Returns:
                A summary; `failures` lists the commands that failed.
        """
        from robovast.analysis.postprocessing.events import Options
        from robovast.analysis.postprocessing.session import postprocess

        (summary,) = postprocess(self.folder, options or Options(), _PostprocessingLog())
        return summary

    def query(self, sql: str) -> Answer:
        """Query the campaign's tables, which postprocessing makes; see `ask`."""
        from robovast.analysis.tables.query import ask

        return ask([self.folder], sql)


def open_campaign(folder: str | Path) -> Campaign:
    """Open the campaign in a folder.

    Raises:
        InputError: the folder is not a campaign; use `find_campaigns` for a folder of campaigns.
    """
    path = Path(folder).absolute()
    found = find_campaigns(path)
    if found != [path]:
        raise InputError(
            f"{path} is not a campaign, but contains {len(found)} campaigns",
            hint=f"open one of them, for example {found[0].name}",
        )
    return Campaign(path)


def run_campaign(
    document: Document, output: str | Path, options: LocalOptions | None = None
) -> Campaign:
    """Execute a new campaign on this machine until it ends; Ctrl-C ends it early.

    Progress is logged by the logger `robovast.scripting`.

    Args:
        document: the document.
        output: parent of the campaign's new folder.
        options: options of `vast exec local run`; None means its defaults.

    Raises:
        InputError: the document cannot be expanded, or no variant matches `options.select`.
        CannotRunError: the runtime is not usable; nothing was started or created.
        StorageError: `output` cannot be written.
    """
    from robovast.execution.local import LocalOptions
    from robovast.search.local import execute_document

    summary = execute_document(document, Path(output), options or LocalOptions(), _RunLog())
    return Campaign(summary.campaign)


def _stored_run(folder: Path, parameters: Mapping[str, Any]) -> StoredRun:
    record = read_run_record(folder)
    result = record or result_without_record(folder)
    return StoredRun(
        folder=folder,
        variant=folder.parent.name,
        number=int(folder.name),
        verdict=result.verdict,
        reason=result.reason,
        duration=result.duration,
        parameters=record.parameters if record else parameters,
    )


class _RunLog:
    """Logs the events of an execution."""

    def campaign_started(self, campaign: Path, total: int, done: int, how: str) -> None:
        _log.info("%s: %d runs, %d of them finished before; %s", campaign, total, done, how)

    def runs_added(self, count: int) -> None:
        _log.info("%d more runs", count)

    def run_started(self, run: Run) -> None:
        _log.info("%s started", run.path)

    def run_finished(self, run: Run, record: RunRecord) -> None:
        _log.info("%s %s %s", run.path, record.verdict, record.reason)

    def configuration_decided(self, decided: Decided) -> None:
        _log.info("%s: %s", decided.variant, describe_decision(decided.decision))

    def message(self, text: str) -> None:
        _log.info(text)


class _PostprocessingLog:
    """Logs the events of postprocessing."""

    def campaign_started(self, campaign: Path, runs: int) -> None:
        _log.info("%s: postprocessing of %d runs", campaign, runs)

    def step_started(self, title: str, total: int) -> None:
        _log.info("%s (%d)", title, total)

    def step_advanced(self) -> None:
        pass

    def failed(self, failure: Failure) -> None:
        _log.warning("%s", failure)

    def message(self, text: str) -> None:
        _log.info(text)

    def campaign_finished(self, summary: PostprocessingSummary) -> None:
        _log.info("%s: postprocessed", summary.campaign)

"""Campaigns for scripts: execute one here, open one that was executed; `robovast` exports it."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robovast.base.errors import InputError
from robovast.campaign.configurations import read_variants
from robovast.campaign.finding import find_campaigns
from robovast.campaign.layout import Layout
from robovast.campaign.run_record import RunRecord, read_run_record, result_without_record
from robovast.campaign.verdict import Verdict

if TYPE_CHECKING:
    from robovast.analysis.postprocessing.events import CampaignSummary, Failure
    from robovast.analysis.postprocessing.events import Options as PostprocessingOptions
    from robovast.analysis.tables.query import Answer
    from robovast.execution.local import LocalOptions
    from robovast.model.document import Document
    from robovast.model.expansion import Variant
    from robovast.model.plan import Run

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class StoredRun:
    """A run of a campaign, as its folder says."""

    folder: Path
    variant: str
    """Name of its variant."""
    number: int
    """From 0, in its variant."""
    verdict: Verdict
    reason: str
    """Why it did not pass; empty when it did."""
    duration: float | None
    """[s]"""
    parameters: Mapping[str, Any]
    """Scenario parameters that differ from the scenario's defaults."""


@dataclass(frozen=True)
class Campaign:
    """A campaign's folder."""

    folder: Path

    def variants(self) -> list[Variant]:
        """What was to be executed, in order.

        Raises:
            InputError: the campaign does not say it; other tools leave it out.
        """
        return read_variants(Layout(self.folder))[1]

    def runs(self) -> list[StoredRun]:
        """All runs that are stored, by variant and number; also those of other tools."""
        parameters: dict[str, Mapping[str, Any]] = {}
        with suppress(InputError):
            parameters = {variant.name: variant.parameters for variant in self.variants()}
        folders = Layout(self.folder).run_folders()
        return [_stored_run(folder, parameters.get(folder.parent.name, {})) for folder in folders]

    def postprocess(self, options: PostprocessingOptions | None = None) -> CampaignSummary:
        """Turn what runs left into tables, metadata and a graph, where that is not up to date.

        Args:
            options: as of `vast results postprocess`; its defaults when None.

        Returns:
            What was done; commands that did not succeed are in its `failures`.
        """
        from robovast.analysis.postprocessing.events import Options
        from robovast.analysis.postprocessing.session import postprocess

        (summary,) = postprocess(self.folder, options or Options(), _PostprocessingLog())
        return summary

    def query(self, sql: str) -> Answer:
        """Ask the campaign's tables, which postprocessing makes; see `ask`."""
        from robovast.analysis.tables.query import ask

        return ask([self.folder], sql)


def open_campaign(folder: str | Path) -> Campaign:
    """The campaign in a folder.

    Raises:
        InputError: the folder is no campaign; where it holds several, `find_campaigns` has them.
    """
    path = Path(folder).absolute()
    found = find_campaigns(path)
    if found != [path]:
        raise InputError(
            f"{path} is no campaign, but holds {len(found)}: open one of them, for example "
            f"{found[0].name}."
        )
    return Campaign(path)


def run_campaign(
    document: Document, output: str | Path, options: LocalOptions | None = None
) -> Campaign:
    """Execute a new campaign on this machine, to its end; Ctrl-C ends it early.

    What happens is told to the logger `robovast.scripting`.

    Args:
        document: what to execute.
        output: folder in which the campaign's folder is made.
        options: how; as `vast exec local run` does by default when None.

    Raises:
        InputError: the document cannot be expanded, or nothing matches `options.select`.
        CannotRunError: the runtime cannot run it; nothing was started or made.
        StorageError: `output` cannot be written.
    """
    from robovast.execution.local import LocalOptions, run_campaign

    summary = run_campaign(document, Path(output), options or LocalOptions(), _RunLog())
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
    """Writes down what an execution tells."""

    def campaign_started(self, campaign: Path, total: int, done: int, how: str) -> None:
        _log.info("%s: %d runs, %d of them finished before; %s", campaign, total, done, how)

    def run_started(self, run: Run) -> None:
        _log.info("%s started", run.path)

    def run_finished(self, run: Run, record: RunRecord) -> None:
        _log.info("%s %s %s", run.path, record.verdict, record.reason)

    def message(self, text: str) -> None:
        _log.info(text)


class _PostprocessingLog:
    """Writes down what postprocessing tells."""

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

    def campaign_finished(self, summary: CampaignSummary) -> None:
        _log.info("%s: postprocessed", summary.campaign)

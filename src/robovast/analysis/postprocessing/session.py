"""Postprocesses the campaigns in a results folder, one after the other."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

from robovast.analysis.postprocessing import records
from robovast.analysis.postprocessing.campaign import CampaignWork, look
from robovast.analysis.postprocessing.commands import (
    PostprocessingCommand,
    read_calls,
    resolve,
    skipped,
    unfolded,
    why_not,
)
from robovast.analysis.postprocessing.events import (
    Failure,
    Options,
    PostprocessingObserver,
    PostprocessingSummary,
)
from robovast.analysis.postprocessing.finish import finish
from robovast.analysis.postprocessing.plan import all_done
from robovast.analysis.postprocessing.state import opened
from robovast.analysis.postprocessing.survey import Survey
from robovast.analysis.postprocessing.worker import StoppedError
from robovast.analysis.postprocessing.workers import started
from robovast.base.errors import InputError, RobovastError
from robovast.base.yaml_files import read_mapping_leniently
from robovast.campaign.configurations import document_path, read_configurations
from robovast.campaign.discovery import find_campaigns
from robovast.campaign.layout import POSTPROCESSING, Layout
from robovast.model.document.commands import ROSOUT
from robovast.model.document.section import PluginCall
from robovast.model.quantities import machine_cpus

LOG = "postprocessing.log"


def postprocess(
    results: Path, options: Options, observer: PostprocessingObserver
) -> list[PostprocessingSummary]:
    """Call the outdated postprocessing commands of every campaign.

    Errors in one campaign are reported in its summary and do not stop the others.

    Args:
        results: folder of campaigns, or of one campaign.
        options: the user's options.
        observer: receives progress events.

    Raises:
        InputError: there is no campaign, or the overriding .vast file cannot be read.
    """
    campaigns = [folder.absolute() for folder in find_campaigns(results)]
    if options.override is not None:
        read_calls(options.override)
    summaries = []
    for campaign in campaigns:
        summary = PostprocessingSummary(campaign)
        summaries.append(summary)
        try:
            _postprocess(campaign, options, observer, summary)
        except StoppedError:
            summary.interrupted = True
            break
        except RobovastError as error:
            failure = Failure(campaign.name, "postprocess", "", str(error), error.exit_code)
            summary.failures.append(failure)
            observer.failed(failure)
        observer.campaign_finished(summary)
    return summaries


def _postprocess(
    campaign: Path,
    options: Options,
    observer: PostprocessingObserver,
    summary: PostprocessingSummary,
) -> None:
    layout = Layout(campaign)
    document = summary.document = options.override or _document(layout)
    survey = Survey(campaign, document)
    runs = survey.runs()
    asked = read_calls(document) if document else []
    calls = _calls(asked, options, _Tell(observer, summary))
    implied = _implied(asked, options, survey, runs, observer)
    folder = document.absolute().parent if document else layout.config
    commands = resolve([*calls, *implied], folder, _given(layout, options), quiet=implied)
    summary.runs, summary.commands = len(runs), len(commands)
    observer.campaign_started(campaign, len(runs))
    _work(survey, runs, commands, options, observer, summary)


def call_commands(
    campaign: Path,
    document: Path,
    calls: Sequence[PluginCall],
    observer: PostprocessingObserver,
    *,
    tables: bool,
) -> PostprocessingSummary:
    """Call the outdated ones of these commands for a campaign that is still executed.

    Args:
        campaign: the campaign's folder.
        document: its .vast file.
        calls: the commands.
        observer: receives progress events.
        tables: also make the tables of queries.
    """
    summary = PostprocessingSummary(campaign)
    layout, options = Layout(campaign), Options(skip_metadata=True, skip_tables=not tables)
    survey = Survey(campaign, document)
    usable = [call for call in unfolded(calls) if _Tell(observer, summary).can_be_called(call)]
    commands = resolve(usable, document.absolute().parent, _given(layout, options))
    _work(survey, survey.runs(), commands, options, observer, summary)
    return summary


def _work(
    survey: Survey,
    runs: Sequence[str],
    commands: Sequence[PostprocessingCommand],
    options: Options,
    observer: PostprocessingObserver,
    summary: PostprocessingSummary,
) -> None:
    """Call outdated commands, then write what is made from all results."""
    layout = Layout(survey.campaign)
    with opened(survey.campaign) as state:
        units = look(survey, state, runs, force=options.force)
        if not all_done(commands, units):
            started_at, count = _now(), options.jobs or machine_cpus()
            with (
                _log(layout, options) as log,
                started(count, log, options.time_limit) as workers,
            ):
                work = CampaignWork(survey, state, workers, observer, summary, units)
                work.work_off(commands)
            _record(layout, commands, started_at)
        finish(survey, state, units, options, observer, summary)


def _document(layout: Layout) -> Path | None:
    """The campaign's .vast file; None if it has none, for example after an early abort."""
    found = layout.documents
    if len(found) < 2:
        return next(iter(found), None)
    named = document_path(layout, read_configurations(layout))
    if named in found:
        return named
    raise InputError(
        f"{layout.config} holds {len(found)} .vast files",
        hint="name the one to use with `--override FILE`",
    )


def _calls(asked: Sequence[PluginCall], options: Options, tell: _Tell) -> list[PluginCall]:
    """The calls of a document that are not skipped and can be called.

    Raises:
        InputError: the document has no command of a skipped name.
    """
    names = [name for name in options.skip if not (name == ROSOUT and _logs_are_implied(asked))]
    calls = unfolded(skipped(asked, names))
    if options.skip_rosout:
        calls = [call for call in calls if call.name != ROSOUT]
    return [call for call in calls if tell.can_be_called(call)]


def _implied(
    asked: Sequence[PluginCall],
    options: Options,
    survey: Survey,
    runs: Sequence[str],
    observer: PostprocessingObserver,
) -> list[PluginCall]:
    """The implied conversion of logs, which is done even if the document does not list it."""
    skips = options.skip_rosout or ROSOUT in options.skip
    if skips or not _logs_are_implied(asked) or not survey.has_recording(runs):
        return []
    logs = PluginCall(name=ROSOUT)
    reason = why_not(logs)
    if reason is not None:
        observer.message(f"Logs are not converted: {reason}")
    return [logs] if reason is None else []


def _logs_are_implied(asked: Sequence[PluginCall]) -> bool:
    return all(call.name != ROSOUT for call in unfolded(asked))


def _given(layout: Layout, options: Options) -> dict[str, Any]:
    """Arguments that commands receive besides their parameters."""
    image = read_mapping_leniently(layout.execution_record).get("image")
    asked = {"debug": options.debug, "force": options.force}
    known = {"execution_image": image} if image else {}
    return known | {name: True for name, wanted in asked.items() if wanted}


@dataclass(frozen=True)
class _Tell:
    """Reports once per command why it cannot be called."""

    observer: PostprocessingObserver
    summary: PostprocessingSummary

    def can_be_called(self, call: PluginCall) -> bool:
        """False if the command can never be called."""
        reason = why_not(call)
        if reason is not None:
            failure = Failure(self.summary.campaign.name, call.name, "", reason)
            self.summary.failures.append(failure)
            self.observer.failed(failure)
        return reason is None


@contextmanager
def _log(layout: Layout, options: Options) -> Iterator[IO[bytes]]:
    """The destination of the plugins' output."""
    if options.debug:
        yield sys.stderr.buffer
        return
    layout.execution.mkdir(exist_ok=True)
    with (layout.execution / LOG).open("ab") as file:
        yield file


def _record(layout: Layout, commands: Sequence[PostprocessingCommand], started_at: str) -> None:
    """Record commands and times for the campaign's provenance."""
    layout.transient.mkdir(exist_ok=True)
    listed = [{"plugin": command.name, "params": command.parameters} for command in commands]
    path = layout.transient / POSTPROCESSING
    records.update(path, [], started_at=started_at, ended_at=_now(), commands=listed)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")

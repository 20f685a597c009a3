"""Calls all outdated commands for one run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

from robovast.analysis.postprocessing import records
from robovast.analysis.postprocessing.commands import PostprocessingCommand
from robovast.analysis.postprocessing.content import Files, changed
from robovast.analysis.postprocessing.outcome import CommandOutcome, Entry
from robovast.analysis.postprocessing.state import Unit
from robovast.analysis.postprocessing.survey import Survey
from robovast.analysis.postprocessing.worker import PluginWorker


@dataclass(frozen=True)
class RunWork:
    """Work done for a run."""

    unit: Unit
    """Current state of the run."""
    outcomes: list[tuple[PostprocessingCommand, CommandOutcome]]


def request(command: PostprocessingCommand, campaign: Path, results: Path) -> dict[str, Any]:
    """The data that a worker needs to call a command."""
    return {
        "name": command.name,
        "parameters": command.parameters,
        "given": dict(command.given),
        "quiet": command.quiet,
        "folder": str(command.folder),
        "campaign": str(campaign),
        "results_dir": str(results),
    }


def work_on_run(
    worker: PluginWorker, survey: Survey, unit: Unit, commands: Sequence[PostprocessingCommand]
) -> RunWork:
    """Call commands for a run, one after the other; failures do not stop later commands.

    Raises:
        StoppedError: the user asked to stop; nothing is recorded as finished.
        OSError: the run's record cannot be written.
    """
    work = RunWork(unit, [])
    entries: list[Entry] = []
    before = survey.files(unit.path)
    folder = survey.folder(unit.path)
    for reads_bags, group in groupby(commands, lambda command: command.reads_bags):
        for together in [list(group)] if reads_bags else [[command] for command in group]:
            outcomes = _call(worker, survey.campaign, folder, together)
            after = survey.files(unit.path)
            made = [f"{unit.path}/{name}" for name in changed(before, after)]
            said = [entry for outcome in outcomes for entry in outcome.entries]
            called = together[0]
            entries += records.with_found(said, made, called.name, called.parameters)
            work = _added(work, survey, before, after, zip(together, outcomes, strict=True))
            before = after
    records.merge(survey.campaign, entries)
    return work


def _call(
    worker: PluginWorker, campaign: Path, folder: Path, commands: Sequence[PostprocessingCommand]
) -> list[CommandOutcome]:
    calls = [request(command, campaign, folder) for command in commands]
    return worker.convert_bags(calls) if commands[0].reads_bags else [worker.call(calls[0])]


def _added(
    work: RunWork,
    survey: Survey,
    before: Files,
    after: Files,
    outcomes: Iterable[tuple[PostprocessingCommand, CommandOutcome]],
) -> RunWork:
    listed = list(outcomes)
    unit = survey.worked(work.unit, before, after)
    done = {command.key for command, outcome in listed if outcome.success}
    return RunWork(replace(unit, done=unit.done | done), work.outcomes + listed)

"""Postprocesses one campaign: calls outdated commands in the order of the document."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from robovast.analysis.postprocessing import records
from robovast.analysis.postprocessing.commands import PostprocessingCommand
from robovast.analysis.postprocessing.content import Files, changed, combined
from robovast.analysis.postprocessing.events import (
    Failure,
    PostprocessingObserver,
    PostprocessingSummary,
)
from robovast.analysis.postprocessing.outcome import CommandOutcome
from robovast.analysis.postprocessing.plan import Step, plan, taken_back
from robovast.analysis.postprocessing.run_step import request, work_on_run
from robovast.analysis.postprocessing.state import TableState, Unit
from robovast.analysis.postprocessing.survey import OWN, WHOLE, Survey
from robovast.analysis.postprocessing.workers import Workers

_KEPT = 200
"""Number of runs after which finished work is stored."""
_NOTICES = 10
"""Number of different messages that are shown per step."""


def look(survey: Survey, state: TableState, runs: Iterable[str], *, force: bool) -> dict[str, Unit]:
    """The current state of every unit, including `WHOLE`.

    Claims that no longer hold are withdrawn immediately.

    Args:
        survey: the campaign's survey.
        state: the stored state.
        runs: the campaign's runs.
        force: withdraw all claims.
    """
    known = state.units()
    units = survey.look_at_all([OWN, *runs], known)
    whole = known.get(WHOLE, Unit(WHOLE))
    inputs = _inputs(units)
    holds = whole.inputs == inputs and not _spoilt(units, known)
    units[WHOLE] = whole if holds else Unit(WHOLE, inputs=inputs)
    if force:
        units = {path: replace(unit, done=frozenset()) for path, unit in units.items()}
    gone = known.keys() - units.keys()
    moved = [unit for path, unit in units.items() if known.get(path) != unit]
    if gone or moved:
        state.remove(gone)
        state.store(moved)
    return units


def _spoilt(units: Mapping[str, Unit], known: Mapping[str, Unit]) -> bool:
    """Whether a command's output, in any folder, was removed or changed."""
    before = ((unit, known.get(path)) for path, unit in units.items())
    return any(old is not None and unit.made != old.made for unit, old in before)


def per_run_keys(
    commands: Iterable[PostprocessingCommand], survey: Survey, workers: Workers
) -> set[str]:
    """Keys of the commands that are called for each run."""
    found = {command.key for command in commands if command.reads_bags}
    with workers.one() as worker:
        for command in commands:
            if command.key not in found:
                call = request(command, survey.campaign, survey.campaign)
                found.update([command.key] if worker.per_run(call) else [])
    return found


@dataclass
class CampaignWork:
    """Executes the commands of one campaign."""

    survey: Survey
    state: TableState
    workers: Workers
    observer: PostprocessingObserver
    summary: PostprocessingSummary
    units: dict[str, Unit]
    """Current state of all units, kept up to date."""

    def work_off(self, commands: Sequence[PostprocessingCommand]) -> None:
        """Call all outdated commands.

        Raises:
            StoppedError: the user asked to stop; finished work is stored.
        """
        steps = plan(commands, per_run_keys(commands, self.survey, self.workers), self.units)
        self._keep(taken_back(steps, self.units).values())
        for step in steps:
            if step.runs is None:
                self._work_on_campaign(step.commands[0])
            else:
                self._work_on_runs(step, step.runs)
        self._keep([replace(self.units[WHOLE], inputs=_inputs(self.units))])

    def _keep(self, units: Iterable[Unit]) -> None:
        listed = list(units)
        self.units.update((unit.path, unit) for unit in listed)
        self.state.store(listed)

    def _work_on_runs(
        self, step: Step, runs: Mapping[str, Sequence[PostprocessingCommand]]
    ) -> None:
        self.observer.step_started(", ".join(c.title for c in step.commands), len(runs))
        self.summary.worked.update(runs)
        items = [(self.units[path], calls) for path, calls in runs.items()]
        finished: list[Unit] = []
        notices = Notices()
        try:
            for work in self.workers.map(
                lambda worker, item: work_on_run(worker, self.survey, *item), items
            ):
                finished.append(work.unit)
                for command, outcome in work.outcomes:
                    self._note(command, work.unit.path, outcome, notices)
                self.observer.step_advanced()
                if len(finished) >= _KEPT:
                    self._keep(finished)
                    finished = []
        finally:
            self._keep(finished)
        notices.tell(self.observer)

    def _work_on_campaign(self, command: PostprocessingCommand) -> None:
        self.observer.step_started(command.title, 1)
        campaign = self.survey.campaign
        paths = [path for path in self.units if path != WHOLE]
        self.summary.worked.update(path for path in paths if path != OWN)
        before = {path: self.survey.files(path) for path in paths}
        with self.workers.one() as worker:
            outcome = worker.call(request(command, campaign, campaign))
        made = list(self._created_files(before))
        found = records.with_found(outcome.entries, made, command.name, command.parameters)
        records.merge(campaign, found)
        if outcome.success:
            whole = self.units[WHOLE]
            self._keep([replace(whole, done=whole.done | {command.key})])
        notices = Notices()
        self._note(command, "", outcome, notices)
        self.observer.step_advanced()
        notices.tell(self.observer)

    def _created_files(self, before: Mapping[str, Files]) -> Iterator[str]:
        """Files that changed since, relative to the campaign; also updates the units."""
        moved: list[Unit] = []
        for path, files in before.items():
            after = self.survey.files(path)
            if after != files:
                moved.append(self.survey.worked(self.units[path], files, after))
                prefix = "" if path == OWN else f"{path}/"
                yield from (prefix + name for name in changed(files, after))
        self._keep(moved)

    def _note(
        self, command: PostprocessingCommand, run: str, outcome: CommandOutcome, notices: Notices
    ) -> None:
        """Add a command's messages to the notices, or its failure to the summary."""
        if outcome.success:
            for line in outcome.message.splitlines():
                notices.add(f"{command.title}: {line}", run)
            return
        message = outcome.message or "reported a failure without a reason"
        failure = Failure(self.survey.campaign.name, command.title, run, message)
        self.summary.failures.append(failure)
        self.observer.failed(failure)


class Notices:
    """Messages of commands about runs; equal messages are shown once."""

    def __init__(self) -> None:
        self._runs: dict[str, list[str]] = {}

    def add(self, text: str, run: str) -> None:
        """Add a message about a run, or about the whole campaign (empty)."""
        self._runs.setdefault(text, []).append(run)

    def tell(self, observer: PostprocessingObserver) -> None:
        """Show the most frequent messages."""
        ordered = sorted(self._runs.items(), key=lambda item: -len(item[1]))
        for text, runs in ordered[:_NOTICES]:
            more = f" and {len(runs) - 1} more" if len(runs) > 1 else ""
            observer.message(f"{text} ({min(runs)}{more})" if runs[0] else text)
        if len(ordered) > _NOTICES:
            observer.message(f"… and {len(ordered) - _NOTICES} more messages")


def _inputs(units: Mapping[str, Unit]) -> str:
    return combined({path: unit.inputs for path, unit in units.items() if path != WHOLE})

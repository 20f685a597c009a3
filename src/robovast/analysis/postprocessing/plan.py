"""Decides which commands to call for which runs, before the first call."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import groupby

from robovast.analysis.postprocessing.commands import PostprocessingCommand
from robovast.analysis.postprocessing.state import Unit
from robovast.analysis.postprocessing.survey import OWN, WHOLE


@dataclass(frozen=True)
class Step:
    """Commands that are called for each run, or one that is called for the whole campaign."""

    commands: tuple[PostprocessingCommand, ...]
    runs: Mapping[str, tuple[PostprocessingCommand, ...]] | None
    """Commands for each run; None for a command on the whole campaign."""


def all_done(commands: Iterable[PostprocessingCommand], units: Mapping[str, Unit]) -> bool:
    """Whether all commands are up to date, per run or for the whole campaign."""
    runs = [unit.done for path, unit in units.items() if path not in (OWN, WHOLE)]
    every = frozenset.intersection(*runs) if runs else frozenset()
    return {command.key for command in commands} <= every | units[WHOLE].done


def plan(
    commands: Sequence[PostprocessingCommand], per_run: Set[str], units: Mapping[str, Unit]
) -> list[Step]:
    """The steps to execute, in order.

    Commands may read the output of preceding ones: after a call, all later commands are called, for
    the same run or, if either command takes the whole campaign, for all runs. Commands that read
    bags do not depend on one another.

    Args:
        commands: in execution order.
        per_run: keys of the commands that are called for each run.
        units: stored state of the runs and of the campaign (`WHOLE`).
    """
    steps: list[Step] = []
    for alone, group in groupby(commands, lambda command: command.key in per_run):
        if alone:
            steps += _on_runs(tuple(group), units, bool(steps))
            continue
        for command in group:
            if steps or command.key not in units[WHOLE].done:
                steps.append(Step((command,), None))
    return steps


def _on_runs(
    commands: tuple[PostprocessingCommand, ...], units: Mapping[str, Unit], renewed: bool
) -> list[Step]:
    runs = {
        path: calls
        for path, unit in units.items()
        if path not in (OWN, WHOLE) and (calls := _stale(commands, unit.done, renewed))
    }
    called = {command.key for calls in runs.values() for command in calls}
    return [Step(tuple(c for c in commands if c.key in called), runs)] if runs else []


def _stale(
    commands: Iterable[PostprocessingCommand], done: Set[str], renewed: bool
) -> tuple[PostprocessingCommand, ...]:
    calls: list[PostprocessingCommand] = []
    for command in commands:
        before = (call for call in calls if not (call.reads_bags and command.reads_bags))
        follows = renewed or any(before)
        if follows or command.key not in done:
            calls.append(command)
    return tuple(calls)


def taken_back(steps: Iterable[Step], units: Mapping[str, Unit]) -> dict[str, Unit]:
    """Units changed by the steps, without the claims that the steps will renew."""
    found: dict[str, Unit] = {}
    for step in steps:
        calls = {WHOLE: step.commands} if step.runs is None else step.runs
        for path, commands in calls.items():
            unit = found.get(path, units[path])
            less = unit.without(command.key for command in commands)
            if less != unit:
                found[path] = less
    return found

"""Which commands are to be called, and for which runs: decided before the first is called."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import groupby

from robovast.analysis.postprocessing.commands import Command
from robovast.analysis.postprocessing.state import Unit
from robovast.analysis.postprocessing.survey import OWN, WHOLE


@dataclass(frozen=True)
class Step:
    """Commands that are called for runs side by side, or one that is called for all at once."""

    commands: tuple[Command, ...]
    runs: Mapping[str, tuple[Command, ...]] | None
    """What to call for each run; None for a command that takes the campaign as a whole."""


def all_done(commands: Iterable[Command], units: Mapping[str, Unit]) -> bool:
    """Whether nothing is stale, whatever the commands are called for."""
    runs = [unit.done for path, unit in units.items() if path not in (OWN, WHOLE)]
    every = frozenset.intersection(*runs) if runs else frozenset()
    return {command.key for command in commands} <= every | units[WHOLE].done


def plan(commands: Sequence[Command], per_run: Set[str], units: Mapping[str, Unit]) -> list[Step]:
    """The steps to take, in order.

    A command may read what those before it made: when one is called, so are all after it, of the
    same run or, where either takes the campaign as a whole, of all runs. Those that read bags need
    nothing of each other.

    Args:
        commands: in the order in which they are worked off.
        per_run: keys of the commands that are called for each run.
        units: what each of them, and the campaign (`WHOLE`), has finished.
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


def _on_runs(commands: tuple[Command, ...], units: Mapping[str, Unit], renewed: bool) -> list[Step]:
    runs = {
        path: calls
        for path, unit in units.items()
        if path not in (OWN, WHOLE) and (calls := _stale(commands, unit.done, renewed))
    }
    called = {command.key for calls in runs.values() for command in calls}
    return [Step(tuple(c for c in commands if c.key in called), runs)] if runs else []


def _stale(commands: Iterable[Command], done: Set[str], renewed: bool) -> tuple[Command, ...]:
    calls: list[Command] = []
    for command in commands:
        before = (call for call in calls if not (call.reads_bags and command.reads_bags))
        follows = renewed or any(before)
        if follows or command.key not in done:
            calls.append(command)
    return tuple(calls)


def taken_back(steps: Iterable[Step], units: Mapping[str, Unit]) -> dict[str, Unit]:
    """The units that claim what the steps are about to do again, without these claims."""
    found: dict[str, Unit] = {}
    for step in steps:
        calls = {WHOLE: step.commands} if step.runs is None else step.runs
        for path, commands in calls.items():
            unit = found.get(path, units[path])
            less = unit.without(command.key for command in commands)
            if less != unit:
                found[path] = less
    return found

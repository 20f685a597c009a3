"""Reduce a failed run in front of a user: print the steps and the result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from robovast.analysis.minimise.minimising import (
    End,
    Minimised,
    continue_minimising,
    minimise_run,
)
from robovast.analysis.minimise.record import MinimiseStep
from robovast.analysis.minimise.record import shown as shown_value
from robovast.analysis.minimise.shrinking import Items, Ladder
from robovast.base.errors import ExitCode, InputError
from robovast.base.sequential import SequentialTest
from robovast.base.statistics import anytime, interval_text
from robovast.evaluation.launch.commands import as_shell
from robovast.execution.local import LocalOptions
from robovast.execution.local.replay import find_run
from robovast_cli.ui.campaign import view
from robovast_cli.ui.output import say
from robovast_cli.ui.table import format_table
from robovast_cli.workspace import shown

ERROR = 0.1
"""Probability that a step is judged wrongly."""
MOST = 20
"""Runs of a step at most, unless more are needed to call one good."""


def minimised(
    folder: Path,
    output: Path,
    resumed: Path | None,
    budget: int,
    rates: tuple[float, float],
    **options: Any,
) -> ExitCode:
    """Reduce a failed run, or resume that; print the result and return the exit code."""
    test, chosen = _test(*rates), LocalOptions(**options)
    run = find_run(folder)
    with view() as shows:
        if resumed is None:
            found = minimise_run(run, output, test, budget, chosen, shows)
        else:
            found = continue_minimising(run, resumed, budget, chosen, shows)
    for line in _lines(found, folder, budget):
        say(line)
    return ExitCode.INTERRUPTED if found.end is End.INTERRUPTED else ExitCode.OK


def _test(good: float, bad: float) -> SequentialTest:
    if not 0 < good < bad < 1:
        raise InputError(
            "--good must be less than --bad, and both must be between 0 and 1 (got "
            f"{good:g} and {bad:g})."
        )
    test = SequentialTest(good, bad, ERROR)
    return SequentialTest(good, bad, ERROR, most=max(MOST, 2 * test.shortest(False)))


def _lines(found: Minimised, folder: Path, budget: int) -> Iterator[str]:
    yield ""
    best, run = found.best, found.request.run.partition("/")[2]
    if best is None:
        yield f"{run}: inconclusive whether it fails again."
    elif best.changes:
        runs = f"{best.judged.failed} of {best.judged.runs} runs"
        interval = interval_text(anytime(best.judged.failed, best.judged.runs))
        yield f"{run} still fails, in {runs} (95 % interval {interval}): {best.judged.reason}"
        yield format_table(
            ["PARAMETER", "NOW", "WAS", "LEAST EXTREME TRIED"], _rows(found)
        ).rstrip()
    else:
        yield f"{run}: no less extreme values were found that fail."
    if found.end is not End.MINIMAL:
        ended = "Interrupted" if found.end is End.INTERRUPTED else "The budget is used up"
        more = [] if found.end is End.INTERRUPTED else [f"--budget={2 * budget}"]
        words = ["minimise", str(folder), f"--resume={shown(found.campaign)}", *more]
        yield f"{ended}; less extreme values may exist. Continue: {as_shell(words)}"
    if best is not None:
        yield f"Reproduce: {as_shell(['replay', str(shown(found.campaign / best.example))])}"
    yield f"Steps: {shown(found.campaign / 'minimise.json')}"


def _rows(found: Minimised) -> Iterator[list[str]]:
    """What each reduction came to."""
    first, best = found.steps[0].parameters, found.best
    assert best is not None  # noqa: S101
    for reduction in found.request.reductions:
        name = reduction.parameter
        was, now = shown_value(first[name]), shown_value(best.parameters[name])
        mildest = shown_value(_mildest(reduction, found.steps))
        tried = "none" if mildest == was else str(mildest)
        if isinstance(reduction, Items):
            yield [name, f"{now} of {was} items", "", f"{tried} items"]
        else:
            yield [name, str(now), "" if was == now else str(was), tried]


def _mildest(reduction: Items | Ladder, steps: Sequence[MinimiseStep]) -> Any:
    """The mildest value of a parameter among those that were tried."""
    tried = (step.parameters[reduction.parameter] for step in steps)
    return min(tried, key=len if isinstance(reduction, Items) else reduction.values.index)

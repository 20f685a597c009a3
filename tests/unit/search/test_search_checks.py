"""What is wrong with a `search` is said when its file is read, with the place."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import DocumentError
from robovast.model.document import load_document

SCENARIO = (
    "scenario test:\n    x: int = 1\n    y: float = 0.5\n    do serial:\n        wait elapsed(1s)\n"
)
LATER = """\
import sys
class A:
    def __init__(self, *args, **params):
        sys.exit("later")
B = 3
"""
GOOD = """\
version: 1
execution: {scenario_file: scenario.osc}
search:
  strategy: random
  search_space:
    x: {type: int, low: 1, high: 9}
  objectives: [{name: failure_rate}]
  budget: [{batches: 3}]
"""


def problems(folder: Path, text: str) -> str:
    (folder / "scenario.osc").write_text(SCENARIO)
    (folder / "test.vast").write_text(text)
    (folder / "leaves.py").write_text("import sys\nsys.exit('at once')\n")
    (folder / "later.py").write_text(LATER)
    try:
        load_document(folder / "test.vast")
    except DocumentError as error:
        return str(error)
    return ""


def test_defaults_and_warning_without_budget(tmp_path: Path) -> None:
    assert problems(tmp_path, GOOD) == ""
    stop = GOOD.replace("budget: [{batches: 3}]", "stopping: [{target_objective: 1}]")
    assert problems(tmp_path, stop) == ""
    document = load_document(tmp_path / "test.vast")
    assert document.vast.search is not None
    assert document.vast.search.objectives[0].direction == "maximize"
    assert "the search may never end" in str(document.warnings[0])


def test_a_parameter_that_is_given_twice_in_the_template_is_refused(tmp_path: Path) -> None:
    text = GOOD.replace("  search_space:\n", "  parameters: [{y: 0.1}, {y: $x}]\n  search_space:\n")
    found = problems(tmp_path, text)
    assert "test.vast:5" in found
    assert "the parameter `y` is given twice" in found


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("low: 1", "low: 0, log: true", "a logarithmic scale needs `low` above 0"),
        ("low: 1", "low: 10", "with `low` at most `high`"),
        ("low: 1", "low: 1.5", "must be whole numbers"),
        ("high: 9", "high: .inf", "must be finite"),
        ("low: 1", "low: 1, step: 0", "must be at least 1"),
        ("type: int, low: 1, high: 9", "type: choice, values: [a, b, a]", 'value "a" occurs twice'),
        *(
            ("type: int, low: 1, high: 9", f"type: choice, values: [{odd}, b]", "cannot be stored")
            for odd in (".nan", ".inf", "{1: a}", "!!binary aGVsbG8=")
        ),
        (
            "type: int, low: 1, high: 9",
            "type: float, low: -1.7e308, high: 1.7e308",
            "too far apart for a floating point number",
        ),
        ("type: int, low: 1, high: 9", "type: bool, low: 1", "`low` has no meaning here"),
        ("    x:", "    z:", "has no parameter `z`"),
        ("strategy: random", "strategy: randm", "Did you mean `random`?"),
        ("name: failure_rate", "name: failurerate", "Did you mean `failure_rate`?"),
        (
            "[{name: failure_rate}]",
            "[{name: failure_rate}, {name: failure_rate}]",
            "the objective `failure_rate` occurs twice",
        ),
        ("batches: 3", "batch: 3", "unknown key `batch`"),
        ("batches: 3", "batches: 0", "must be at least 1"),
        ("[{batches: 3}]", "[{batches: 3, time: 4}]", "must be one of `batches`, `time`"),
        ("[{batches: 3}]", "[]", "a search needs a `budget` or"),
        (
            "  budget",
            "  stopping: [{no_improvement: {patience: 2, min_delta: -1}}]\n  budget",
            "must be at least 0",
        ),
        (
            "  budget",
            "  stopping: [{metric: {name: coverage, value: 1}}]\n  budget",
            "`random` reports no `coverage`",
        ),
        ("  budget", "  parameters: [{y: $xx}]\n  budget", "`$xx` names no dimension"),
        (
            "  budget",
            "  parameters: [{y: '${x'}]\n  budget",
            "test.vast:8:20: search.parameters[0].y: the marker `${x` lacks its closing brace",
        ),
        (
            "  budget",
            "  variations: [{ParameterVariationList: {nam: y, values: [$x]}}]\n  budget",
            "Did you mean `name`?",
        ),
        (
            "strategy: random",
            "strategy: qd\n  strategy_parameters: {archive: {measures: {a: {low: 0, high: 1}}}}",
            "`qd` needs the measure `a`, which `extract` does not give",
        ),
        ("  budget", "  extract: {plugin: nothing.py:E}\n  budget", "there is no plugin file"),
        ("  budget", "  extract: {params: {a: 1}}\n  budget", "`failure_rate` cannot be created"),
        ("strategy: random", "strategy: leaves.py:A", "cannot be imported: SystemExit: at once"),
        ("strategy: random", "strategy: later.py:A", "later.py:4)"),
        ("strategy: random", "strategy: later.py:B", "'int' object is not callable"),
        ("  budget", "  extract: {plugin: leaves.py:A}\n  budget", "SystemExit: at once"),
        ("  budget", "  extract: {plugin: later.py:A}\n  budget", "later.py:4)"),
    ],
)
def test_bad_input(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert message in problems(tmp_path, GOOD.replace(old, new, 1))


def test_several_objectives_are_refused_by_strategies_of_one(tmp_path: Path) -> None:
    text = GOOD.replace("[{name: failure_rate}]", "[{name: failure_rate}, {name: b}]")
    boundary = text.replace("strategy: random", "strategy: boundary")
    assert "`boundary` optimizes one objective" in problems(tmp_path, boundary)
    given = "strategy: optuna\n  strategy_parameters: {sampler: cmaes}"
    cmaes = problems(tmp_path, text.replace("strategy: random", given))
    assert "search.strategy: `optuna`: `cmaes` optimizes one objective" in cmaes


def test_a_seed_of_null_is_one_that_can_be_repeated(tmp_path: Path) -> None:
    assert problems(tmp_path, GOOD + "  seed: null\n") == ""
    document = load_document(tmp_path / "test.vast")
    assert document.vast.search is not None
    assert document.vast.search.seed == 0

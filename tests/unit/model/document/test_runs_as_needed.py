"""What `execution.runs` may be, and the message for each that it may not be."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import DocumentError
from robovast.base.sequential import SequentialTest
from robovast.model.document import Document, load_document

SEARCH = """\
search:
  strategy: random
  search_space:
    x: {type: int, low: 1, high: 9}
  objectives: [{name: failure_rate}]
  budget: [{batches: 3}]
"""


def load(folder: Path, runs: str, more: str = "") -> Document:
    """A document with these runs, in line 4."""
    (folder / "s.osc").write_text(
        "scenario test:\n    x: int = 1\n    do serial:\n        wait elapsed(1s)\n"
    )
    path = folder / "c.vast"
    path.write_text(f"version: 1\nexecution:\n  scenario_file: s.osc\n  runs: {runs}\n{more}")
    return load_document(path)


def test_a_number_is_that_many_runs(tmp_path: Path) -> None:
    execution = load(tmp_path, "5").vast.execution
    assert (execution.runs, execution.most_runs, execution.test()) == (5, 5, None)


def test_rates_to_decide_between_are_a_test_of_at_most_so_many_runs(tmp_path: Path) -> None:
    document = load(tmp_path, "{decide: {good: 0.05, bad: 0.2}}")
    execution = document.vast.execution
    assert execution.most_runs == 50
    assert execution.test() == SequentialTest(0.05, 0.2, 0.05, least=3, most=50)
    assert execution.test(2) == SequentialTest(0.05, 0.2, 0.05, least=2, most=2)
    assert not document.warnings


def test_too_few_runs_for_a_decision_are_warned_of(tmp_path: Path) -> None:
    (warning,) = load(tmp_path, "{max: 10, decide: {good: 0.05, bad: 0.2}}").warnings
    assert (
        "c.vast:4:9: execution.runs: no configuration can be classified as passing after 10"
        in str(warning)
    )
    assert "It takes at least 18" in str(warning)


@pytest.mark.parametrize(
    ("runs", "said"),
    [
        ("{min: 5, max: 3, decide: {good: 0.1, bad: 0.6}}", "`min` must be at most `max`, and 5"),
        ("{decide: {good: 0.6, bad: 0.6}}", "`good` must be less than `bad`"),
        ("{decide: {good: 0.7, bad: 0.6}}", "`good` must be less than `bad`, and 0.7"),
        ("{decide: {good: a, bad: 0.6}}", "decide.good: must be a number, not 'a'"),
        ("{decide: {good: 0, bad: 0.6}}", "decide.good: must be greater than 0, not 0"),
        ("{decide: {good: .nan, bad: 0.6}}", "decide.good: must be"),
        ("{decide: {good: 0.1, bad: 1}}", "decide.bad: must be less than 1, not 1"),
        ("{decide: {good: 0.1, bad: 0.6, error: 0.5}}", "error: must be less than 0.5, not 0.5"),
        ("{decide: {good: 0.1, bad: 0.6, error: 0}}", "error: must be greater than 0, not 0"),
        ("{min: 0, decide: {good: 0.1, bad: 0.6}}", "runs.min: must be at least 1, not 0"),
        ("{max: 200000, decide: {good: 0.1, bad: 0.6}}", "runs.max: must be at most 100000"),
        ("{max: 3}", "the key `decide` is missing"),
        ("{decide: {good: 0.1}}", "the key `bad` is missing"),
        ("{decide: often}", "decide: must be a mapping, not 'often'"),
        ("{mx: 3, decide: {good: 0.1, bad: 0.6}}", "unknown key `mx`"),
        ("often", "must be a whole number, not 'often'"),
        ("0", "must be at least 1, not 0"),
        ("[5]", "must be a whole number, not a list"),
    ],
)
def test_what_cannot_be_decided_is_refused_where_it_stands(
    tmp_path: Path, runs: str, said: str
) -> None:
    with pytest.raises(DocumentError) as refused:
        load(tmp_path, runs)
    (problem,) = refused.value.problems
    assert "c.vast:4:" in str(problem)
    assert said in str(problem)


def test_a_search_has_a_number_of_runs(tmp_path: Path) -> None:
    with pytest.raises(DocumentError) as refused:
        load(tmp_path, "{decide: {good: 0.05, bad: 0.2}}", SEARCH)
    (problem,) = refused.value.problems
    assert "c.vast:4:9: execution.runs: must be a number if a `search` choos" in str(problem)

"""What a strategy, its proposals and its errors are: none of it breaks the search's history."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from threading import Event
from typing import Any

import pytest

from robovast.base.errors import InputError
from robovast.base.plugins import plugin_errors, raised
from robovast.campaign.layout import Layout
from robovast.model.document import Document, load_document
from robovast.model.packs import RUNS_LIMIT
from robovast.search.batches import Rounds
from robovast.search.extractor import Extractor, ExtractResult
from robovast.search.history import BatchOutcome, Proposal, SearchHistory
from robovast.search.plugins import search_of
from robovast.search.proposing import ask
from robovast.search.scoring import score
from robovast.search.strategy import SearchStrategy
from robovast.search.types import ParamSet, SearchReport

SCENARIO = (
    "scenario test:\n    x: int = 1\n    y: float = 0.5\n    do serial:\n        wait elapsed(1s)\n"
)
DOCUMENT = """\
version: 1
execution: {scenario_file: scenario.osc}
search:
  strategy: random
  search_space:
    x: {type: int, low: 1, high: 9}
    y: {type: float, low: -1, high: 9}
  objectives: [{name: failure_rate}]
  per_batch: 3
  budget: [{batches: 3}]
"""


@pytest.fixture
def document(tmp_path: Path) -> Document:
    (tmp_path / "scenario.osc").write_text(SCENARIO)
    (tmp_path / "test.vast").write_text(DOCUMENT)
    return load_document(tmp_path / "test.vast")


class Says(SearchStrategy):
    """A strategy that proposes what it is given."""

    answer: Any = ()

    def ask(self, n: int) -> list[ParamSet]:
        return self.answer  # type: ignore[no-any-return]

    def tell(self, evaluations: Any) -> None: ...

    def report(self) -> SearchReport:
        return SearchReport()


def asked(document: Document, answer: Any) -> list[ParamSet]:
    strategy = Says(search_of(document))
    strategy.answer = answer
    return ask(document, strategy)


class Mute:
    """An object that cannot be shown, nor be a value."""

    def __repr__(self) -> str:
        raise OSError("no")

    def item(self) -> float:
        raise OSError("no")


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (Mute(), "cannot be read: OSError: no"),
        ([ParamSet({"x": Mute(), "y": 1.0}, "id")], "cannot be read: OSError: no"),
        ([ParamSet({"x": 10**400, "y": 1.0})], "not in the space"),
        ([ParamSet({"x": 1, "y": float("nan")})], "not in the space"),
        ((x for x in "ab"), "must return a list of ParamSet"),
    ],
)
def test_a_proposal_that_is_none_is_the_strategys_error(
    document: Document, answer: Any, why: str
) -> None:
    with pytest.raises(InputError, match=f"the strategy `random` .*{why}"):
        asked(document, answer)


def test_equal_numbers_make_equal_sets(document: Document) -> None:
    for pair in ((1, 1.0), (0.0, -0.0)):
        one, other = asked(document, [ParamSet({"x": 1, "y": y}) for y in pair])
        assert one.id == other.id


class Empty:
    """A campaign without variants."""

    variants = ()

    def index(self, name: str) -> None: ...

    def runs_of(self, name: str) -> int:
        return 0


def test_more_runs_than_a_campaign_can_have_are_refused_before_they_are_stored(
    document: Document, tmp_path: Path
) -> None:
    unused: Any = dict.fromkeys(("process", "finished", "expand", "elapsed"))
    campaign: Any = Empty()
    history = SearchHistory(Layout(tmp_path))
    made = Rounds(
        document=document, campaign=campaign, history=history, extractor=Fails(), **unused
    )
    sets = [ParamSet({"x": x, "y": 1.0}, n_reps=RUNS_LIMIT // 2) for x in (1, 2)]
    names = {params.id: f"c{params.id}" for params in sets}
    assert sum(block.size for block in made._blocks(sets, names)) == RUNS_LIMIT
    with pytest.raises(InputError, match="has 10,000,001 runs, more than 10,000,000"):
        made._blocks([*sets[:1], ParamSet(sets[1].values, n_reps=RUNS_LIMIT // 2 + 1)], names)


def passed_runs(folder: Path, number: int) -> None:
    """Make runs of a configuration that have passed."""
    for run in range(number):
        (folder / str(run)).mkdir(parents=True)
        (folder / str(run) / "test.xml").write_text('<testsuite tests="1"><testcase/></testsuite>')


class SpeechlessError(Exception):
    """An exception that cannot say what it is."""

    def __str__(self) -> str:
        raise ValueError


class Fails(Extractor):
    """An extractor that raises."""

    error: Exception = SpeechlessError()

    def extract(self, config_dir: Path) -> ExtractResult:
        raise self.error


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (SpeechlessError(), "SpeechlessError: (its text cannot be had: ValueError)"),
        (ValueError("no \ud800"), "ValueError: no \\ud800"),
        (ValueError("a" + "x" * (9 << 20) + "z"), "ValueError: axxx"),
    ],
)
def test_whatever_an_extractor_raises_can_be_stored_and_read_again(
    document: Document, tmp_path: Path, error: Exception, told: str
) -> None:
    passed_runs(tmp_path / "c", 2)
    params = ParamSet({"x": 1, "y": 1.0})
    extractor = Fails()
    extractor.error = error
    scores = score(search_of(document), extractor, Layout(tmp_path), {params.id: "c"}, ())
    assert scores[0].error.startswith(told)
    history = SearchHistory(Layout(tmp_path))
    batch = history.propose(Proposal(1, "random", "1", 0, 0, (params,), ("c",), ()))
    history.finish(batch, BatchOutcome(scores, 1.0, 2.0))
    assert SearchHistory(Layout(tmp_path)).batches == history.batches
    scores[0].error.encode()


class Hangs(Extractor):
    """An extractor that waits for ever, or for a program that does, in one of two sets."""

    def extract(self, config_dir: Path) -> ExtractResult:
        if config_dir.name == "hangs":
            try:
                subprocess.run(["sleep", "1000"], check=False)
            except Exception:  # as careful code may have it
                Event().wait()
        return ExtractResult({"failure_rate": 0.0}, {})


def test_an_extractor_that_hangs_leaves_its_set_out_and_says_where(
    document: Document, tmp_path: Path
) -> None:
    configs = {"first": "hangs", "second": "returns"}
    for config in configs.values():
        passed_runs(tmp_path / config, 1)
    hanging, other = score(search_of(document), Hangs(), Layout(tmp_path), configs, (), longest=1.0)
    said = r"TimeoutError: it did not end within 1 s and was stopped \(.*test_proposals\.py:\d+\)"
    assert re.fullmatch(said, hanging.error)
    assert (other.error, other.objectives) == ("", {"failure_rate": 0.0})


def test_what_a_plugin_raises_is_told_with_its_place_however_it_is_nested() -> None:
    with (
        pytest.raises(InputError, match=r"outer: inner: KeyError: 1 \(.*test_proposals.py:\d+\)"),
        plugin_errors(lambda error: InputError(f"outer: {error}")),
        plugin_errors(lambda error: InputError(f"inner: {raised(error)}")),
    ):
        raise KeyError(1)


def test_an_interrupt_stays_one() -> None:
    with (
        pytest.raises(KeyboardInterrupt),
        plugin_errors(lambda error: InputError(f"outer: {error}")),
    ):
        raise KeyboardInterrupt

"""The failure map: it finds the border with fewer sets than chance, and says how sure it is."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from random import Random
from typing import Any

import numpy as np
import pytest
from scipy.special import expit

from robovast.model.document.search.section import Search
from robovast.search.strategies.boundary import BoundaryParameters, BoundaryStrategy
from robovast.search.strategies.failure_process import Array
from robovast.search.strategy import SearchStrategy
from robovast.search.types import Evaluation, ParamSet

SPACE = {
    "speed": {"type": "float", "low": 1.0, "high": 5.0},
    "load": {"type": "int", "low": 0, "high": 10},
    "surface": {"type": "choice", "values": ["dry", "wet"]},
}


def strategy(
    seed: int = 0, space: Mapping[str, Any] = SPACE, per_batch: int = 1, **keys: Any
) -> BoundaryStrategy:
    given = {"search_space": space, "objectives": [{"name": "failure_rate"}], "seed": seed}
    given |= {"per_batch": per_batch}
    cfg = Search.model_validate({"strategy": "boundary", "budget": [{"batches": 9}], **given})
    return BoundaryStrategy(cfg, BoundaryParameters(**keys))


def chance(values: dict[str, Any]) -> float:
    """On a wet surface it fails above about 3, on a dry one above about 4; load counts little."""
    limit = (3.0 if values["surface"] == "wet" else 4.0) - 0.05 * values["load"]
    return float(expit(12.0 * (values["speed"] - limit)))


def evaluate(params: ParamSet, runs: int = 3) -> Evaluation:
    generator = Random(params.id)  # noqa: S311
    count = params.n_reps or runs
    failures = sum(generator.random() < chance(params.values) for _ in range(count))
    return Evaluation(params, {"failure_rate": failures / count}, {}, count)


def execute(made: SearchStrategy, batches: int) -> list[list[ParamSet]]:
    asked = []
    for _ in range(batches):
        asked.append(made.ask(6))
        made.tell([evaluate(params) for params in asked[-1]])
    return asked


def share_wrong(made: BoundaryStrategy) -> float:
    generator = np.random.default_rng(1)
    units: Array = generator.random((400, 3))
    units[:, 2] = np.where(units[:, 2] < 0.5, 0.25, 0.75)
    names = ["dry", "wet"]
    truth = [
        chance({"speed": 1 + 4 * u[0], "load": 10 * u[1], "surface": names[int(u[2] > 0.5)]}) > 0.5
        for u in units
    ]
    assert made.process is not None
    mean, _ = made.process.predict(units)
    return float(np.mean((mean > 0) != truth))


def test_the_map_is_better_than_one_of_random_sets_and_knows_the_critical_values() -> None:
    made, filled = strategy(), strategy(initial=48)
    execute(made, 8)
    execute(filled, 8)
    assert share_wrong(made) <= 0.05
    assert share_wrong(made) <= share_wrong(filled)
    numbers = made.map().numbers()
    assert numbers["failing_low"] <= 0.41 <= numbers["failing_high"]
    assert numbers["misjudged"] < 0.1
    for surface, limit in (("wet", 2.75), ("dry", 3.75)):
        base = made.place(ParamSet({"speed": 3.0, "load": 5, "surface": surface}))
        speed = made.map().critical(base)[0]
        assert (speed.name, speed.above) == ("speed", "fails")
        assert speed.low is not None
        assert speed.high is not None
        assert speed.low - 0.1 <= limit <= speed.high + 0.1
        assert speed.high - speed.low < 1.0


def test_each_place_where_it_begins_or_ceases_to_fail_has_a_critical_value() -> None:
    space = {"gain": {"type": "float", "low": 0.0, "high": 12.0}}
    made = strategy(space=space)
    for _ in range(6):
        sets = made.ask(6)
        fails = [not 3.0 < params.values["gain"] < 9.0 for params in sets]
        made.tell(
            [
                Evaluation(params, {"failure_rate": float(one)}, {}, 5)
                for params, one in zip(sets, fails, strict=True)
            ]
        )
    first, second = made.map().critical([0.5])
    assert (first.above, second.above) == ("passes", "fails")
    assert first.value == pytest.approx(3.0, abs=0.7)
    assert second.value == pytest.approx(9.0, abs=0.7)
    assert first.low is not None
    assert first.high is not None
    assert first.low < 3.0 < first.high


@pytest.mark.parametrize(("limit", "end"), [(0.2, "low"), (6.0, None), (11.5, "high")])
def test_an_interval_that_reaches_the_end_of_the_space_says_so(
    limit: float, end: str | None
) -> None:
    space = {"gain": {"type": "float", "low": 0.0, "high": 12.0}}
    made = strategy(space=space)
    for _ in range(3):
        sets = made.ask(4)
        fails = [float(params.values["gain"] > limit) for params in sets]
        given = zip(sets, fails, strict=True)
        made.tell([Evaluation(p, {"failure_rate": rate}, {}, 2) for p, rate in given])
    (found,) = made.map().critical([0.5])
    assert found.open == end
    assert found.low is not None
    assert found.high is not None
    assert found.low <= limit <= found.high
    assert (found.low == 0.0, found.high == 12.0) == (end == "low", end == "high")


def test_sets_that_no_result_changes_are_asked_for_before_there_is_any() -> None:
    """The batches of the even filling do not depend on what is known."""
    ahead, told = strategy(per_batch=4, initial=10), strategy(per_batch=4, initial=10)
    for filled in (4, 8):
        assert ahead.fills
        sets = told.ask(4)
        assert ahead.ask(4) == sets
        assert len(ahead.asked) == filled
        told.tell([evaluate(params) for params in sets])
    assert not ahead.fills, "the map decides on two of the next four"


def test_it_is_a_function_of_seed_and_history() -> None:
    whole, rebuilt = strategy(), strategy()
    asked = execute(whole, 3)
    for sets in asked:
        rebuilt.repeat(6, sets)
        rebuilt.tell([evaluate(params) for params in sets])
    assert rebuilt.ask(6) == whole.ask(6)
    assert execute(strategy(seed=1), 1) != asked[:1]


def test_noise_is_answered_with_more_runs_of_known_sets() -> None:
    """A small space has few sets; where the coin is fair, they are run more often."""
    cfg = Search.model_validate(
        {
            "strategy": "boundary",
            "search_space": {"load": {"type": "int", "low": 0, "high": 3}},
            "objectives": [{"name": "failure_rate"}],
            "budget": [{"batches": 9}],
        }
    )
    made = BoundaryStrategy(cfg, BoundaryParameters())
    sets = made.ask(4)
    made.tell([Evaluation(p, {"failure_rate": 0.5}, {}, 2) for p in sets])
    again = [params for _ in range(3) for params in made.ask(4)]
    assert any(params.n_reps == 4 for params in again)


def test_runs_that_errored_are_no_reason_to_ask_for_nothing_new() -> None:
    """All sets of a small space are known; of each 16 runs, two came to a verdict."""
    cfg = Search.model_validate(
        {
            "strategy": "boundary",
            "search_space": {"load": {"type": "int", "low": 0, "high": 1}},
            "objectives": [{"name": "failure_rate"}],
            "budget": [{"batches": 9}],
        }
    )
    made = BoundaryStrategy(cfg, BoundaryParameters())
    planned: dict[str, int] = {}
    for batch in range(4):
        sets = made.ask(2)
        before = dict(planned)
        for params in sets:
            planned[params.id] = max(params.n_reps or 16, planned.get(params.id, 0))
        assert planned != before, f"batch {batch} asks for nothing new"
        made.tell([Evaluation(p, {"failure_rate": 0.5}, {}, 2, n_runs=planned[p.id]) for p in sets])


def test_an_objective_that_is_no_rate_is_refused() -> None:
    made = strategy()
    (params, *_) = made.ask(1)
    with pytest.raises(ValueError, match="needs a rate between 0 and 1"):
        made.tell([Evaluation(params, {"failure_rate": 7.0}, {}, 1)])


def test_a_batch_asked_ahead_keeps_away_from_the_one_under_way_and_is_repeated_alike() -> None:
    """Two batches are open at a time, as a search on workers that vary in speed asks them."""
    asked = []

    def ahead(made: BoundaryStrategy, batches: int) -> None:
        open_ = [made.ask(6)]
        for batch in range(1, batches):
            if batch > 1:
                made.tell([evaluate(params) for params in open_.pop(0)])
            open_.append(made.ask(6))
            asked.append([*open_[-1]])

    whole = strategy()
    ahead(whole, 6)
    ids = [params.id for sets in asked for params in sets if params.n_reps is None]
    assert len(ids) == len(set(ids)), "a set under way is proposed once more"
    gaps = [
        min(np.linalg.norm(np.subtract(whole.place(a), whole.place(b))) for a in one for b in other)
        for one, other in pairwise(asked[2:])
    ]
    assert min(gaps) > 0.01
    again = asked[:]
    asked.clear()
    ahead(strategy(), 6)
    assert asked == again

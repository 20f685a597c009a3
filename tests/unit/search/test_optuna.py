"""`optuna`: the best set with the real package, the same ones after any death."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.optional import needs

needs("optuna")
needs("cmaes")

from robovast.base.errors import CannotRunError  # noqa: E402
from robovast.model.document.search.plugins import (  # noqa: E402
    STRATEGIES,
    load_search_plugin,
)
from robovast.model.document.search.section import Search  # noqa: E402
from robovast.search.strategies.optuna_samplers import (  # noqa: E402
    OptunaParameters,
    OptunaStrategy,
)
from robovast.search.types import Evaluation, ParamSet  # noqa: E402

SPACE = {
    "gain": {"type": "float", "low": 0.01, "high": 10.0, "log": True},
    "load": {"type": "int", "low": 0, "high": 11, "step": 4},
    "size": {"type": "int", "low": 1, "high": 1000, "log": True, "step": 3},
    "surface": {"type": "choice", "values": ["dry", "wet", [1, 2]]},
    "night": {"type": "bool"},
}
LINE = {name: {"type": "float", "low": -1.0, "high": 1.0} for name in "abcd"}
SAMPLERS = ["tpe", "cmaes", "random"]


def strategy(
    space: dict[str, Any], objectives: tuple[str, ...] = ("loss",), seed: int = 0, **keys: Any
) -> OptunaStrategy:
    cfg = Search.model_validate(
        {
            "strategy": "optuna",
            "search_space": space,
            "objectives": [{"name": name, "direction": "minimize"} for name in objectives],
            "budget": [{"batches": 9}],
            "per_batch": 6,
            "seed": seed,
        }
    )
    return OptunaStrategy(cfg, OptunaParameters(**keys))


def distance(params: ParamSet) -> Evaluation:
    """How far it is from (0.6, 0.6, …)."""
    loss = sum((value - 0.6) ** 2 for value in params.values.values())
    return Evaluation(params, {"loss": loss}, {}, 1)


def execute(made: OptunaStrategy, batches: int) -> list[list[ParamSet]]:
    asked = []
    for _ in range(batches):
        asked.append(made.ask(6))
        made.tell([distance(params) for params in asked[-1]])
    return asked


def best(sampler: str, seed: int) -> float:
    made = strategy(LINE, seed=seed, sampler=sampler)
    execute(made, 20)
    return float(made.report().extra["best_value"])


@pytest.mark.parametrize("sampler", ["tpe", "cmaes"])
def test_it_finds_better_sets_than_chance(sampler: str) -> None:
    assert sum(best(sampler, seed) for seed in range(3)) < 0.5 * sum(
        best("random", seed) for seed in range(3)
    )


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_it_is_a_function_of_seed_and_history(sampler: str) -> None:
    whole, rebuilt = strategy(LINE, sampler=sampler), strategy(LINE, sampler=sampler)
    asked = execute(whole, 4)
    for sets in asked:
        rebuilt.repeat(6, sets)
        rebuilt.tell([distance(params) for params in sets])
    assert rebuilt.ask(6) == whole.ask(6)
    assert execute(strategy(LINE, sampler=sampler, seed=1), 1) != asked[:1]


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_all_dimensions_keep_to_their_values(sampler: str) -> None:
    made = strategy(SPACE, sampler=sampler, seed=-1)
    seen: dict[str, set[Any]] = {name: set() for name in SPACE}
    for _ in range(8):
        sets = made.ask(6)
        for params in sets:
            for name, value in params.values.items():
                seen[name].add(str(value))
            assert (params.values["size"] - 1) % 3 == 0
            assert 0.01 <= params.values["gain"] <= 10.0
        made.tell([Evaluation(p, {"loss": p.values["gain"]}, {}, 1) for p in sets])
    assert seen["load"] == {"0", "4", "8"}
    assert seen["surface"] == {"dry", "wet", "[1, 2]"}
    assert seen["night"] == {"True", "False"}


@pytest.mark.parametrize("sampler", ["tpe", "random"])
def test_each_set_of_a_small_space_is_proposed_once(sampler: str) -> None:
    made = strategy({"a": {"type": "int", "low": 0, "high": 7}}, sampler=sampler)
    asked = [params.values["a"] for sets in execute(made, 3) for params in sets]
    assert sorted(asked) == list(range(8))


def test_cmaes_goes_on_where_sets_are_left_out_and_in_one_dimension() -> None:
    made = strategy({"a": LINE["a"]}, sampler="cmaes")
    for _ in range(10):
        made.tell([distance(params) for params in made.ask(6)[1:]])
    assert made.report().extra["best_value"] < 1e-3


def test_several_objectives_give_a_front() -> None:
    made = strategy(LINE, ("near", "far"))
    for _ in range(4):
        made.tell(
            [
                Evaluation(
                    p, {"near": p.values["a"] ** 2, "far": (p.values["a"] - 0.5) ** 2}, {}, 1
                )
                for p in made.ask(6)
            ]
        )
    report = made.report()
    assert report.best is None
    assert len(report.evaluations) == 24
    for one in report.front:
        for other in report.evaluations:
            better = [other.objectives[o.name] < one.objectives[o.name] for o in made.objectives]
            assert not all(better)
    with pytest.raises(ValueError, match="`cmaes` optimizes one objective"):
        strategy(LINE, ("near", "far"), sampler="cmaes")


def test_a_missing_extra_is_named_with_its_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robovast.base.optional_deps.find_spec", lambda _: None)
    with pytest.raises(CannotRunError, match=r"pip install .*\[optuna\]"):
        load_search_plugin("optuna", STRATEGIES, Path())

"""Which factors explain failures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from itertools import product
from random import Random
from typing import Any

import pytest

from robovast.campaign.verdict import Verdict
from robovast.evaluation.effects import effects
from robovast.evaluation.summaries import RunSummary, VariantRuns

Chance = Callable[[Mapping[str, Any]], float]


def campaign(
    chance: Chance, seed: int, values: Mapping[str, list[Any]], runs: int = 5
) -> list[VariantRuns]:
    """All combinations of the values; each run fails with a chance that depends on them."""
    random = Random(seed)  # noqa: S311
    variants = []
    for number, combination in enumerate(product(*values.values())):
        parameters = dict(zip(values, combination, strict=True))
        found = tuple(
            RunSummary(n, _verdict(random.random() < chance(parameters)), "", None, None)
            for n in range(runs)
        )
        variants.append(VariantRuns(f"v-{number}", "v", parameters, found))
    return variants


def hidden(seed: int, parameters: Mapping[str, Any]) -> float:
    """A chance of each configuration that follows from none of its parameters."""
    return Random(f"{seed} {parameters}").random()  # noqa: S311


def _verdict(bad: bool) -> Verdict:
    return Verdict.FAILED if bad else Verdict.PASSED


GRID: dict[str, list[Any]] = {
    "speed": [0.2, 0.4, 0.8, 1.2],
    "margin": [0.02, 0.1],
    "plan": ["depot", "flat", "hall"],
    "fixed": [7],
}


def test_the_parameter_that_matters_comes_first_with_its_threshold() -> None:
    found = effects(campaign(lambda p: 0.9 if p["speed"] > 0.5 else 0.05, 1, GRID))
    first = found[0]
    assert (first.factor, first.worse.condition, first.better.condition) == (
        "speed",
        "> 0.4",
        "≤ 0.4",
    )
    assert first.p < 0.01
    assert first.low < 0.85 < first.high
    assert first.low > 0.5
    assert "fixed" not in {effect.factor for effect in found}


def test_one_text_of_several_is_told_from_the_others() -> None:
    (first, *_) = effects(campaign(lambda p: 0.8 if p["plan"] == "hall" else 0.1, 2, GRID))
    assert (first.factor, first.worse.condition) == ("plan", "= hall")
    assert first.p < 0.01


def test_chance_alone_is_rarely_called_a_cause() -> None:
    """Also where the configurations differ for reasons that no parameter shows."""
    alarms = 0
    for seed in range(100):
        variants = campaign(partial(hidden, seed), seed, GRID)
        alarms += effects(variants)[0].p < 0.05
    assert alarms <= 11  # 5 are expected; 12 or more have a chance of 0.4 %


def test_failures_that_belong_to_configurations_are_not_many_witnesses() -> None:
    """20 runs of each of four configurations, two of which always fail, show nothing."""
    found = effects(campaign(lambda p: p["x"] > 2, 3, {"x": [1, 2, 3, 4]}, runs=20))
    assert found[0].p > 0.05


def test_parameters_that_divide_equally_are_told_once() -> None:
    variants = [
        VariantRuns(
            f"v-{n}",
            "v",
            {"map": f"{n % 2}.yaml", "mesh": f"{n % 2}.stl"},
            (RunSummary(0, _verdict(n % 2 == 0), "", None, None),),
        )
        for n in range(12)
    ]
    (only,) = effects(variants)
    assert (only.factor, only.same) == ("map", ("mesh",))


@pytest.mark.parametrize("chance", [0.0, 1.0])
def test_nothing_explains_what_always_or_never_happens(chance: float) -> None:
    assert effects(campaign(lambda _: chance, 1, GRID)) == []


def test_interrupted_runs_and_odd_values_are_no_evidence() -> None:
    interrupted = RunSummary(0, Verdict.INTERRUPTED, "", None, None)
    failed = RunSummary(0, Verdict.FAILED, "", None, None)
    passed = RunSummary(0, Verdict.PASSED, "", None, None)
    variants = [
        VariantRuns("a", "v", {"x": 1.0, "pose": {"x": 1}, "_private": 1}, (failed, interrupted)),
        VariantRuns("b", "v", {"x": float("nan"), "pose": None, "_private": 2}, (passed,)),
        VariantRuns("c", "v", {"x": "text", "pose": {"x": 1}}, (passed,)),
        VariantRuns("d", "v", {}, (interrupted,)),
    ]
    found = effects(variants)
    assert {effect.factor for effect in found} == {"pose"}
    assert found[0].worse.runs + found[0].better.runs == 3


def test_each_configuration_with_its_own_text_is_no_parameter_to_split_by() -> None:
    variants = campaign(lambda p: float(p["name"] > "m"), 1, {"name": list("abcxyz")})
    assert effects(variants) == []

"""Each run has a seed of its own, the same on every machine and whatever is appended."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from robovast.execution.job_config import own_environment, parameter_documents
from robovast.model.plan import PackStart, Run, plan_runs, plan_variants
from robovast.model.scenario import Scenario, read_scenario
from robovast.model.seeds import LARGEST_SEED, draw_seed, run_seed
from robovast.model.variant import Variant

HALL = Variant("hall-1", "hall", {"speed": 1.0})
ROOM = Variant("room-1", "room", {})


def seeds(variants: list[Variant], runs: int, seed: int | None = 7) -> dict[str, int | None]:
    plan = plan_variants(variants, runs)
    return {run.path: run.seed for run in plan_runs(plan, variants, seed)}


def test_a_seed_is_the_documented_hash() -> None:
    whole = int(hashlib.sha256(b"7/hall-1/2").hexdigest()[:8], 16)
    assert run_seed(7, "hall-1", 2) == whole % 2**31 == 675973403


def test_appending_runs_and_selecting_variants_change_no_seed() -> None:
    few, many = seeds([HALL, ROOM], 3), seeds([HALL, ROOM], 10)
    assert few.items() <= many.items()
    assert seeds([ROOM], 10).items() <= many.items()


def test_runs_have_different_seeds_of_31_bits() -> None:
    found = list(seeds([HALL, ROOM], 500).values())
    assert len(set(found)) == 1000
    assert all(seed is not None and 0 <= seed <= LARGEST_SEED for seed in found)
    assert seeds([HALL], 1) != seeds([HALL], 1, seed=8)
    assert draw_seed() != draw_seed()


def test_a_campaign_of_an_older_version_goes_on_without_seeds() -> None:
    assert set(seeds([HALL], 2, seed=None).values()) == {None}


def scenario(tmp_path: Path, parameter: str) -> Scenario:
    path = tmp_path / "scenario.osc"
    path.write_text(f"scenario drive:\n    {parameter}\n    do serial:\n        wait\n")
    return read_scenario(path)


@pytest.mark.parametrize("declared", ["seed: int = 1", "seed: uint", "seed: float = 0.5"])
def test_a_scenario_that_declares_a_seed_gets_it(tmp_path: Path, declared: str) -> None:
    job = PackStart(0, (Run(0, HALL, 0, 42),))
    assert "seed: 42\n" in parameter_documents(job, scenario(tmp_path, declared))


@pytest.mark.parametrize("declared", ["speed: float = 1.0", "seed: string", "seed: list of int"])
def test_no_other_scenario_gets_one(tmp_path: Path, declared: str) -> None:
    job = PackStart(0, (Run(0, HALL, 0, 42),))
    assert "seed" not in parameter_documents(job, scenario(tmp_path, declared))


def test_a_seed_that_the_document_sets_stays(tmp_path: Path) -> None:
    job = PackStart(0, (Run(0, Variant("a", "a", {"seed": 5}), 0, 42),))
    assert "seed: 5\n" in parameter_documents(job, scenario(tmp_path, "seed: int = 1"))


def test_what_serves_several_runs_has_the_seed_of_none() -> None:
    runs = (Run(0, HALL, 0, 42), Run(1, HALL, 1, 0))
    assert "ROBOVAST_SEED" not in own_environment(PackStart(0, runs), "/out")
    assert own_environment(PackStart(0, runs[1:]), "/out")["ROBOVAST_SEED"] == "0"

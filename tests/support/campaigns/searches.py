"""Searches as they are on disk, proposed by real strategies of runs that nobody executed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from random import Random
from typing import Any

from scipy.special import expit

from robovast.base.serialization import dump_yaml
from robovast.campaign.layout import Layout
from robovast.execution.generate import write_configurations
from robovast.model.document import load_document
from robovast.model.expansion import Composition
from robovast.model.packs import Block
from robovast.search.history import BatchOutcome, Proposal, Scored, SearchHistory
from robovast.search.plugins import make_strategy, search_of
from robovast.search.types import ParamSet
from support.campaigns.stored import write, write_run

SCENARIO = """\
scenario test:
    speed: float = 1.0
    load: int = 1
    surface: string = 'dry'
    do serial:
        wait elapsed(1s)
"""
DOCUMENT: dict[str, Any] = {
    "version": 1,
    "metadata": {"name": "limits"},
    "execution": {"scenario_file": "scenario.osc", "runs": 3},
    "search": {
        "strategy": "boundary",
        "strategy_parameters": {"initial": 48},  # nothing is computed to propose
        "search_space": {
            "speed": {"type": "float", "low": 1.0, "high": 5.0},
            "load": {"type": "int", "low": 0, "high": 10},
            "surface": {"type": "choice", "values": ["dry", "wet"]},
        },
        "objectives": [{"name": "failure_rate"}],
        "per_batch": 12,
        "budget": [{"batches": 4}],
    },
}
MEASURED = {
    "extract": {
        "metrics": {
            name: {"table": "out", "column": name, "over_time": "last"} for name in ("way", "time")
        }
    }
}
QD = {
    **MEASURED,
    "strategy": "qd",
    "strategy_parameters": {
        "archive": {"measures": {m: {"low": 0.0, "high": 9.0, "bins": 8} for m in ("way", "time")}}
    },
}
SEVERAL = {
    **MEASURED,
    "strategy": "random",
    "objectives": [{"name": "failure_rate"}, {"name": "time", "direction": "minimize"}],
}
_NUMBERS = {"failing": 0.41, "failing_low": 0.33, "failing_high": 0.52, "misjudged": 0.07}
"""What a map would say, which takes a while to compute."""


def write_search(
    results: Path,
    name: str = "limits-2026-03-07-090000",
    batches: int = 4,
    *,
    runs: bool = True,
    **search: Any,
) -> Path:
    """Write a search, or the further batches of one; returns the campaign's folder.

    `search` replaces keys of its section.

    Above a speed of about 3 the robot fails on a wet surface, above about 4 on a dry one.
    """
    root = results / name
    if search.get("strategy", "boundary") != "boundary":
        search = {"strategy_parameters": {}, **search}
    document = {**DOCUMENT, "search": {**DOCUMENT["search"], **search}}
    source = results.parent / f"source-{name}"
    write(source / "limits.vast", dump_yaml(document))
    write(source / "scenario.osc", SCENARIO)
    loaded = load_document(source / "limits.vast")
    write_configurations(loaded, Composition(()), root, timings=True)
    write(
        root / "_execution" / "execution.yaml",
        "execution_time: '2026-03-07T09:00:00+00:00'\nrobovast_version: 0.1.0\nruns: 3\n"
        "seed: 1\nexecution_type: local\nimage: robots/hall:7\nimage_revision: ''\n",
    )
    strategy, history = make_strategy(loaded), SearchHistory(Layout(root))
    history.replay(strategy)
    written = set(history.configs())
    for number in range(len(history.batches), batches):
        asked = strategy.ask(search_of(loaded).per_batch)
        told = sum(len(history.evaluations(batch)) for batch in history.finished)
        configs = tuple(f"c{params.id}" for params in asked)
        new = [p for p in asked if p.id not in written]
        block = Block(first_variant=len(written), variants=max(1, len(new)), runs=3)
        proposal = Proposal(
            search_of(loaded).per_batch, search_of(loaded).strategy, "0.1.0", 0, told,
            tuple(asked), configs, (block,) if new else (),
        )  # fmt: skip
        batch = history.propose(proposal)
        unique = {params.id: params for params in asked}
        batch.outcome = BatchOutcome(tuple(map(scored, unique.values())), 0.0, 0.0)
        strategy.tell(history.evaluations(batch))
        found = _NUMBERS if search_of(loaded).strategy == "boundary" else strategy.report().extra
        numbers = {k: float(v) for k, v in found.items() if isinstance(v, int | float)}
        elapsed = 60.0 * (number + 1)
        outcome = BatchOutcome(batch.outcome.scores, elapsed, 1772874000.0 + elapsed, numbers)
        history.finish(batch, outcome)
        for params in new:
            if runs:
                _write_runs(root, params, len(written))
            written.add(params.id)
    return root


def chance(values: dict[str, Any]) -> float:
    """How probably a run fails."""
    limit = (3.0 if values["surface"] == "wet" else 4.0) - 0.05 * values["load"]
    return float(expit(12.0 * (values["speed"] - limit)))


def _judge(values: Mapping[str, Any], run: int) -> str:
    return "failed" if _fails(ParamSet(dict(values)), run) else "passed"


def _fails(params: ParamSet, run: int) -> bool:
    return Random(f"{params.id}/{run}").random() < chance(params.values)  # noqa: S311


def scored(params: ParamSet) -> Scored:
    """The score of a set."""
    runs = params.n_reps or 3
    failed = sum(_fails(params, run) for run in range(runs))
    measured = {"way": 9.0 - params.values["speed"], "time": 1.5 + 0.7 * params.values["load"]}
    return Scored(
        params.id, {"failure_rate": failed / runs, "time": measured["time"]}, measured, runs
    )


def _write_runs(root: Path, params: ParamSet, place: int) -> None:
    variant = f"c{params.id}"
    write(root / variant / "_config" / "config.yaml", "config_identifier: abc\n")
    for number in range(3):
        verdict = "failed" if _fails(params, number) else "passed"
        write_run(
            root, variant, number, 3 * place + number, params.values, lambda *_, v=verdict: v, False
        )

"""The 15 limits of the existing tool's search (its facts, section 7): each is none here."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from importlib.metadata import distribution, version
from pathlib import Path
from typing import Any

import pytest
from support.campaigns.local import Recorder, make_campaign
from support.campaigns.searched import (
    DOCUMENT,
    FAILS_ABOVE_50,
    at_random,
    proposed_values,
    run_searched,
    stored_rows,
)
from support.optional import needs
from support.patience import eventually

from robovast.base.errors import DocumentError
from robovast.execution.local import LocalOptions
from robovast.model.document import load_document
from robovast.model.document.search.section import Search
from robovast.search.local import resume
from robovast.search.plugins import make_strategy, strategy_of
from robovast.search.strategies.quality_diversity import QualityDiversityStrategy
from robovast.search.types import Evaluation, ParamSet

needs("optuna")

RANDOM = at_random(3)
OPTUNA = RANDOM.replace("strategy: random", "strategy: optuna") + (
    "  strategy_parameters: {sampler: tpe, n_startup_trials: 2}\n"
)
FILLED = RANDOM.replace("strategy: random", "strategy: boundary") + (
    "  strategy_parameters: {initial: 4}\n"
)
"""The first two batches fill the space, side by side."""
SPACE = {"x": {"type": "float", "low": 0.0, "high": 1.0}}


def section(strategy: str, **keys: Any) -> Search:
    """The section of a search."""
    given = {"search_space": SPACE, "objectives": [{"name": "failure_rate"}], "seed": 5, **keys}
    return Search.model_validate({"strategy": strategy, "budget": [{"batches": 9}], **given})


def archive(**keys: Any) -> dict[str, Any]:
    """Parameters of `qd` over two measures."""
    measures = {name: {"low": 0.0, "high": 1.0} for name in ("a", "b")}
    return {"archive": {"type": "cvt", "cells": 64, "measures": measures}, **keys}


def filled(search: Search) -> QualityDiversityStrategy:
    """`qd` after three batches."""
    made = strategy_of(search, Path("search.vast"))
    assert isinstance(made, QualityDiversityStrategy)
    for _ in range(3):
        sets = made.ask(search.per_batch)
        places = [made.place(params)[0] for params in sets]
        made.tell(
            [
                Evaluation(params, {"failure_rate": spot}, {"a": spot, "b": spot**2}, 1)
                for params, spot in zip(sets, places, strict=True)
            ]
        )
    return made


def refusal(folder: Path, extra: str) -> str:
    """What is said about a document when it is read."""
    path = make_campaign(folder, "", extra, document=DOCUMENT)
    with pytest.raises(DocumentError) as caught:
        load_document(path)
    return str(caught.value)


def test_01_equal_sets_of_a_small_space_are_run_once_until_it_is_exhausted(tmp_path: Path) -> None:
    document = DOCUMENT.replace("high: 100", "high: 2")
    extra = OPTUNA.replace("batches: 3", "batches: 30")
    summary, _ = run_searched(tmp_path, extra, document=document)
    assert summary.stop is not None
    assert summary.stop.kind == "exhausted"
    assert len(summary.records) == 3


@pytest.mark.parametrize("extra", [RANDOM, OPTUNA, FILLED], ids=["random", "optuna", "boundary"])
def test_02_a_killed_search_continues_the_same_sequence(tmp_path: Path, extra: str) -> None:
    """Kill -9 at arbitrary times; the sets are those of a search that nobody disturbed."""
    undisturbed, _ = run_searched(tmp_path / "calm", extra)
    path = make_campaign(tmp_path / "killed", FAILS_ABOVE_50, extra, document=DOCUMENT)
    out = tmp_path / "killed" / "out"
    command = [sys.executable, "-m", "robovast_cli", "--vast-file", str(path), "exec", "local"]
    command += ["run", "--runtime", "process"]
    _killed_after(0.0, [*command, "--output", str(out)], out)
    (campaign,) = out.iterdir()
    for pause in (1.0, 2.2):
        _killed_after(pause, [*command, "--resume", str(campaign)], out)
    summary = resume(campaign, LocalOptions(runtime="process"), Recorder())
    assert proposed_values(campaign) == proposed_values(undisturbed.campaign)
    assert len(summary.records) == len(undisturbed.records) == 6
    assert {record.attempt for record in summary.records} == {1}, "no stored run was repeated"
    values = "SELECT paramset_id, objective FROM unit"
    assert stored_rows(campaign, values) == stored_rows(undisturbed.campaign, values)


def _killed_after(pause: float, command: list[str], out: Path) -> None:
    process = subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL)
    try:
        eventually(lambda: any(out.glob("*/.running/lock")), told="no search runs")
        time.sleep(pause)
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def test_03_errored_runs_are_no_evidence_and_never_the_best_value(tmp_path: Path) -> None:
    extra = RANDOM + "  max_errors: 1\n"
    summary, recorder = run_searched(tmp_path, extra, script='kill -9 "$PPID"; exit 1\n')
    assert summary.stop is not None
    assert summary.stop.kind == "errors"
    assert len(summary.records) == 4, "a set without a verdict is asked once more, then left out"
    assert "they are run again" in " ".join(recorder.messages)
    assert summary.report is not None
    assert summary.report.evaluations == [], "an errored run is no evidence"


def test_04_an_archive_of_cells_is_that_of_its_seed() -> None:
    keys = {"strategy_parameters": archive(), "per_batch": 12}
    one, again, other = (filled(section("qd", **keys, seed=seed)) for seed in (3, 3, 4))
    assert list(one.elites) == list(again.elites)
    assert [ev.params for ev in one.elites.values()] == [ev.params for ev in again.elites.values()]
    assert list(one.elites) != list(other.elites)


@pytest.mark.parametrize("emitters", [1, 3])
def test_05_as_many_sets_are_proposed_as_are_asked(tmp_path: Path, emitters: int) -> None:
    made = filled(section("qd", strategy_parameters=archive(emitters=emitters), per_batch=10))
    assert [len(made.ask(10)) for _ in range(3)] == [10, 10, 10]
    extra = RANDOM.replace("random", "qd")
    extra += "  extract: {metrics: {a: {sql: SELECT 1}, b: {sql: SELECT 2}}}\n"
    extra += f"  strategy_parameters: {json.dumps(archive(emitters=-1))}\n"
    assert "strategy_parameters.emitters: must be at least 1, not -1" in refusal(tmp_path, extra)


def test_06_a_report_of_an_archive_has_its_evaluations() -> None:
    made = filled(section("qd", strategy_parameters=archive(), per_batch=8))
    report = made.report()
    assert len(report.evaluations) == report.extra["evaluations"] == 24
    assert report.best is report.evaluations[0]


@pytest.mark.parametrize("strategy", ["random", "optuna", "qd", "boundary"])
@pytest.mark.parametrize("log", [False, True])
def test_07_steps_are_kept(strategy: str, log: bool) -> None:
    space = {"x": {"type": "int", "low": 2, "high": 13, "step": 4, "log": log}}
    parameters = {"strategy_parameters": archive()} if strategy == "qd" else {}
    made = strategy_of(section(strategy, search_space=space, **parameters), Path("search.vast"))
    found = {params.values["x"] for params in made.ask(3)}
    assert len(found) >= 2
    assert found <= {2, 6, 10}


def test_08_cmaes_has_what_it_needs() -> None:
    parameters = {"sampler": "cmaes"}
    space = {name: {"type": "float", "low": 0.0, "high": 1.0} for name in "xy"}
    search = section("optuna", strategy_parameters=parameters, search_space=space, per_batch=8)
    made = strategy_of(search, Path("search.vast"))
    worst = 0.0
    for _ in range(12):
        sets = made.ask(8)
        rates = [1.0 - abs(p.values["x"] - 0.9) - abs(p.values["y"] - 0.2) for p in sets]
        made.tell(
            [Evaluation(p, {"failure_rate": r}, {}, 1) for p, r in zip(sets, rates, strict=True)]
        )
        worst = max(worst, *rates)
    assert worst > 0.9
    extra = [line for line in distribution("robovast-operator").requires or () if "cmaes" in line]
    assert any('extra == "optuna"' in line.replace("'", '"') for line in extra)


def test_09_several_objectives_are_refused_when_the_file_is_read(tmp_path: Path) -> None:
    extra = RANDOM.replace("[{name: failure_rate}]", "[{name: failure_rate}, {name: y}]")
    extra = extra.replace("random", "boundary")
    extra += "  extract: {metrics: {y: {table: out, column: y, over_time: max}}}\n"
    said = refusal(tmp_path, extra)
    assert "search.objectives: `boundary` optimizes one objective, not several" in said


@pytest.mark.parametrize(
    ("item", "said"),
    [
        ("metric: {name: covrage, value: 1}", "`random` reports no `covrage`"),
        ("no_improvement: {patience: 2, min_delta: -1}", "min_delta: must be at least 0, not -1"),
    ],
)
def test_10_criteria_that_could_never_fire_are_refused(
    tmp_path: Path, item: str, said: str
) -> None:
    assert said in refusal(tmp_path, f"{RANDOM}  stopping: [{{{item}}}]\n")


PLUGINS = '''\
from robovast.search.strategy import SearchStrategy
from robovast.search.types import ParamSet, SearchReport


class Repeats(SearchStrategy):
    """Proposes the same set twice in a batch, and again with more runs later."""

    def __init__(self, cfg, params):
        super().__init__(cfg, params)
        self.told = []

    def ask(self, n):
        if not self.told:
            return [ParamSet({"x": 60}), ParamSet({"x": 60}), ParamSet({"x": 10})]
        return [ParamSet({"x": 60}, n_reps=3), ParamSet({"x": 10})]

    def tell(self, evaluations):
        self.told.append([(ev.params.values["x"], ev.n_samples) for ev in evaluations])

    def report(self):
        return SearchReport(extra={"told": self.told})
'''


def test_11_a_set_of_an_earlier_batch_gets_further_runs_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "plugins.py").write_text(PLUGINS)
    extra = RANDOM.replace("strategy: random", "strategy: ./plugins.py:Repeats")
    extra = extra.replace("batches: 3", "batches: 2").replace("per_batch: 2", "per_batch: 3")
    summary, _ = run_searched(tmp_path, extra)
    assert len(summary.records) == 4, "x = 60 three times, x = 10 once"
    assert summary.report is not None
    assert summary.report.extra["told"] == [[(60, 1), (60, 1), (10, 1)], [(60, 3), (10, 1)]]
    assert (summary.campaign / "_config/plugins.py").is_file()


COUNTS = """\
from pathlib import Path


def count(results_dir, config_dir):
    run = Path(results_dir)
    with run.joinpath("calls").open("a") as calls:
        calls.write("1")
    if (run / "out.csv").read_text().endswith(",FAILS\\n"):
        raise ValueError("this run has no plan")
    return True, ""


count.per_run = True
"""


def test_12_postprocessing_sees_new_runs_alone_and_its_failure_is_said(tmp_path: Path) -> None:
    asked = make_campaign(tmp_path / "asked", "", RANDOM, document=DOCUMENT)
    value = make_strategy(load_document(asked)).ask(2)[0].values["x"]
    (tmp_path / "counts.py").write_text(COUNTS.replace("FAILS", str(value)))
    extra = at_random(2) + "  postprocessing: ['counts.py:count']\n"
    summary, recorder = run_searched(tmp_path, extra)
    calls = [path.read_text() for path in summary.campaign.glob("c*/*/calls")]
    failed = [message for message in recorder.messages if "this run has no plan" in message]
    assert len(calls) == 4
    assert calls.count("1") >= 3, "a run that failed may be tried again, others not"
    assert failed
    assert summary.stop is not None
    assert summary.stop.kind == "batches"


def test_13_twenty_runs_weigh_more_than_two() -> None:
    def sureness(runs: int) -> float:
        made = strategy_of(section("boundary"), Path("search.vast"))
        for spot in (0.2, 0.8):
            params = ParamSet({"x": spot})
            made.repeat(1, [params])
            made.tell([Evaluation(params, {"failure_rate": float(spot > 0.5)}, {}, runs)])
        return float(made.report().extra["misjudged"])

    assert sureness(20) < 0.8 * sureness(2)


SEEDED = 'echo "$ROBOVAST_SEED" > "$3/seed"; [ "$ROBOVAST_SEED" -lt 2000000000 ]\n'


def test_14_seeds_reach_the_simulation_so_that_a_failure_is_repeated(tmp_path: Path) -> None:
    def seeds(name: str) -> dict[str, tuple[str, str]]:
        extra = at_random(1) + "execution: {scenario_file: scenario.osc, seed: 7, "
        extra += "run_files: ['files/*']}\n"
        document = DOCUMENT[: DOCUMENT.index("execution")] + DOCUMENT[DOCUMENT.index("search:") :]
        summary, _ = run_searched(tmp_path / name, extra, SEEDED, document=document, runs=2)
        found = {}
        for path in summary.campaign.glob("c*/*/seed"):
            record = json.loads((path.parent / "run.json").read_text())
            assert int(path.read_text()) == record["seed"]
            found[f"{record['variant']}/{record['run']}"] = (path.read_text(), record["verdict"])
        return found

    first = seeds("first")
    assert len({seed for seed, _ in first.values()}) == 4
    assert seeds("again") == first


def test_15_today_s_optuna_is_used_and_no_ribs() -> None:
    assert int(version("optuna").partition(".")[0]) >= 5
    requires = distribution("robovast-operator").requires or ()
    pins = [line for line in requires if line.startswith(("optuna", "ribs"))]
    assert pins
    assert all(line.startswith("optuna") and "<" not in line.partition(";")[0] for line in pins)

"""Searches as plain processes: end to end, continued after any death, and what goes wrong."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from support.campaigns.local import Recorder, make_campaign
from support.patience import eventually

from robovast.base.errors import InputError
from robovast.execution.local import LocalOptions
from robovast.model.document import load_document
from robovast.search.history import History
from robovast.search.local import SearchSummary, execute_document, resume

DOCUMENT = """\
version: 1
metadata: {name: test_search}
execution:
  scenario_file: scenario.osc
  run_files: ['files/*']
search:
  search_space:
    x: {type: int, low: 0, high: 100}
"""
RANDOM = """\
  strategy: random
  objectives: [{name: failure_rate}]
  per_batch: 2
  budget: [{batches: 3}]
"""
FAILS_ABOVE_50 = 'echo "x,y" > "$3/out.csv"; echo "1,$1" >> "$3/out.csv"; [ "$1" -lt 50 ]\n'


def search(
    folder: Path, extra: str = RANDOM, script: str = FAILS_ABOVE_50, **options: Any
) -> tuple[SearchSummary, Recorder]:
    path = make_campaign(folder, script, extra, document=options.pop("document", DOCUMENT))
    recorder = Recorder()
    chosen = LocalOptions(runtime="process", **options)
    summary = execute_document(load_document(path), folder / "out", chosen, recorder)
    assert isinstance(summary, SearchSummary)
    return summary, recorder


def proposed(campaign: Path) -> list[list[dict[str, Any]]]:
    files = sorted((campaign / "_execution/search").glob("batch-????.json"))
    return [[item["values"] for item in json.loads(file.read_text())["sets"]] for file in files]


def rows(campaign: Path, query: str) -> list[tuple[Any, ...]]:
    with sqlite3.connect(campaign / "campaign.db") as connection:
        return connection.execute(query).fetchall()


def test_random_search_end_to_end(tmp_path: Path) -> None:
    summary, recorder = search(tmp_path, runs=2)
    assert summary.stop is not None
    assert (summary.stop.kind, summary.total, len(summary.records)) == ("batches", 12, 12)
    assert summary.report is not None
    worst = max(values["x"] for batch in proposed(summary.campaign) for values in batch)
    assert summary.report.best is not None
    assert (summary.report.best.objectives["failure_rate"] == 1.0) is (worst >= 50)
    for set_id, objective, samples, params in rows(
        summary.campaign, "SELECT config_name, objective, n_samples, params_json FROM unit"
    ):
        assert (summary.campaign / set_id / "1" / "run.json").is_file()
        assert (objective, samples) == (float(json.loads(params)["x"] >= 50), 2)
    campaign_row = rows(summary.campaign, "SELECT mode, stop_kind, batches FROM campaign")
    assert campaign_row == [("search", "batches", 3)]
    assert "batch 3: batches 3/3" in " ".join(recorder.messages)
    again = resume(summary.campaign, LocalOptions(runtime="process"), Recorder())
    assert again.total == 12, "a budget that is spent leaves nothing to do"


OPTUNA = RANDOM.replace("strategy: random", "strategy: optuna") + (
    "  strategy_parameters: {sampler: tpe, n_startup_trials: 2}\n"
)


@pytest.mark.parametrize("extra", [RANDOM, OPTUNA], ids=["random", "optuna"])
def test_killed_search_continues_the_same_sequence(tmp_path: Path, extra: str) -> None:
    """Kill -9 at arbitrary times; the sets are those of a search that nobody disturbed."""
    undisturbed, _ = search(tmp_path / "calm", extra)
    path = make_campaign(tmp_path / "killed", FAILS_ABOVE_50, extra, document=DOCUMENT)
    out = tmp_path / "killed" / "out"
    command = [sys.executable, "-m", "robovast_cli", "--vast-file", str(path), "exec", "local"]
    command += ["run", "--runtime", "process"]
    _killed_after(0.0, [*command, "--output", str(out)], out)
    (campaign,) = out.iterdir()
    for pause in (1.0, 2.2):
        _killed_after(pause, [*command, "--resume", str(campaign)], out)
    summary = resume(campaign, LocalOptions(runtime="process"), Recorder())
    assert proposed(campaign) == proposed(undisturbed.campaign)
    assert len(summary.records) == len(undisturbed.records) == 6
    assert {record.attempt for record in summary.records} == {1}, "no stored run was repeated"
    values = "SELECT paramset_id, objective FROM unit"
    assert rows(campaign, values) == rows(undisturbed.campaign, values)


def _killed_after(pause: float, command: list[str], out: Path) -> None:
    process = subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL)
    try:
        eventually(lambda: any(out.glob("*/.running/lock")), 30, "no search runs")
        time.sleep(pause)
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def test_each_set_of_a_small_space_is_run_once_until_it_is_exhausted(tmp_path: Path) -> None:
    document = DOCUMENT.replace("high: 100", "high: 2")
    summary, _ = search(tmp_path, RANDOM.replace("batches: 3", "batches: 30"), document=document)
    assert summary.stop is not None
    assert summary.stop.kind == "exhausted"
    assert len(summary.records) == 3


PLUGINS = '''\
import sys
from pathlib import Path

from robovast.search.extractor import Extractor, ExtractResult, completed_run_dirs
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


class Odd(Extractor):
    """Fails for one set, gives nan for another."""

    def extract(self, config_dir: Path):
        (value, *_) = {int(run.joinpath("out.csv").read_text().split(",")[-1])
                       for run in completed_run_dirs(config_dir)}
        if value == 60:
            raise SystemExit("no 60s")
        return ExtractResult({"score": float("nan") if value == 10 else value * self.params["by"]})


class Three(SearchStrategy):
    def ask(self, n):
        return [ParamSet({"x": x}) for x in (10, 60, 3)]

    def tell(self, evaluations):
        self.seen = [ev.objectives["score"] for ev in evaluations]

    def report(self):
        return SearchReport(extra={"seen": self.seen})


class Nonsense(Three):
    def ask(self, n):
        return ASKED


class Leaves(SearchStrategy):
    """Ends the process where it is told to; else it proposes one set, of three that are asked."""

    def __init__(self, cfg, params):
        super().__init__(cfg, params)
        self.at = params["at"]

    def _perhaps(self, method):
        if self.at == method:
            sys.exit("enough")

    def ask(self, n):
        self._perhaps("ask")
        return [ParamSet({"x": 7})]

    def tell(self, evaluations):
        self._perhaps("tell")

    def is_done(self):
        self._perhaps("is_done")
        return False

    def report(self):
        self._perhaps("report")
        return SearchReport(extra={"odd": float("nan"), "fine": 1})
'''


def with_plugins(folder: Path, asked: str = "[]") -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "plugins.py").write_text(PLUGINS.replace("ASKED", asked))


def test_equal_sets_are_run_once_and_more_repetitions_are_added(tmp_path: Path) -> None:
    with_plugins(tmp_path)
    extra = RANDOM.replace("strategy: random", "strategy: ./plugins.py:Repeats")
    extra = extra.replace("batches: 3", "batches: 2").replace("per_batch: 2", "per_batch: 3")
    summary, _ = search(tmp_path, extra)
    assert len(summary.records) == 4, "x = 60 three times, x = 10 once"
    assert summary.report is not None
    assert summary.report.extra["told"] == [[(60, 1), (60, 1), (10, 1)], [(60, 3), (10, 1)]]
    assert (summary.campaign / "_config/plugins.py").is_file()


def test_errors_of_an_extractor_are_the_sets_and_the_search_goes_on(tmp_path: Path) -> None:
    with_plugins(tmp_path)
    extra = """\
  strategy: ./plugins.py:Three
  extract: {plugin: ./plugins.py:Odd, params: {by: 2}}
  objectives: [{name: score, direction: minimize}]
  per_batch: 3
  budget: [{batches: 1}]
"""
    summary, recorder = search(tmp_path, extra)
    assert summary.report is not None
    assert summary.report.extra["seen"] == [6.0]
    told = " ".join(recorder.messages)
    assert "SystemExit: no 60s" in told
    assert "`score` must be a finite number, not nan" in told
    scores = History(_layout(summary.campaign)).scores()
    assert sum("no 60s" in score.trace for score in scores.values()) == 1
    status = "SELECT status FROM unit ORDER BY status"
    assert rows(summary.campaign, status) == [("errored",), ("errored",), ("evaluated",)]


def test_too_many_sets_without_a_score_end_the_search(tmp_path: Path) -> None:
    extra = RANDOM + "  max_errors: 1\n"
    summary, recorder = search(tmp_path, extra, script='kill -9 "$PPID"; exit 1\n')
    assert summary.stop is not None
    assert summary.stop.kind == "errors"
    assert len(summary.records) == 4, "a set without a verdict is asked once more, then left out"
    assert "they are run once more" in " ".join(recorder.messages)
    assert summary.report is not None
    assert summary.report.evaluations == [], "an errored run is no evidence"


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ('[ParamSet({"x": 1000})]', "proposed x = 1000, which is not in the space"),
        ('[ParamSet({"y": 1, "z": 3})]', "a set in which x, y, z is missing or unknown"),
        ("[ParamSet(7)]", "proposed 7 where a mapping of values is asked"),
        ('[ParamSet({"x": 1}, n_reps=0)]', "wants 0 repetitions"),
        ("None", "`ask` must return a list of ParamSet, not None"),
        ('[ParamSet({"x": x}) for x in range(9)]', "proposed 9 sets where 2 are asked"),
    ],
)
def test_nonsense_of_a_strategy_is_refused_before_anything_exists(
    tmp_path: Path, asked: str, message: str
) -> None:
    with_plugins(tmp_path, asked)
    extra = RANDOM.replace("strategy: random", "strategy: ./plugins.py:Nonsense")
    with pytest.raises(InputError, match=message):
        search(tmp_path, extra)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("method", ["ask", "tell", "is_done", "report"])
def test_a_strategy_that_ends_the_process_is_one_clear_error(tmp_path: Path, method: str) -> None:
    with_plugins(tmp_path)
    extra = RANDOM.replace("strategy: random", "strategy: ./plugins.py:Leaves")
    extra += f"  strategy_parameters: {{at: {method}}}\n"
    with pytest.raises(InputError, match=rf"`{method}` raised SystemExit: enough \(.*plugins.py:"):
        search(tmp_path, extra)


def test_fewer_sets_than_asked_and_numbers_that_are_none_do_no_harm(tmp_path: Path) -> None:
    with_plugins(tmp_path)
    extra = RANDOM.replace("strategy: random", "strategy: ./plugins.py:Leaves")
    extra += "  strategy_parameters: {at: never}\n"
    summary, _ = search(tmp_path, extra)
    assert len(summary.records) == 1
    batches = History(_layout(summary.campaign)).batches
    assert [dict(batch.outcome.metrics) for batch in batches if batch.outcome] == [{"fine": 1}] * 3


def test_a_template_that_makes_several_configurations_is_refused(tmp_path: Path) -> None:
    extra = RANDOM + "  variations: [{ParameterVariationList: {name: x, values: [$x, 3]}}]\n"
    with pytest.raises(InputError, match="make 2 configurations of the parameter set"):
        search(tmp_path, extra)
    assert not (tmp_path / "out").exists()


def _layout(campaign: Path) -> Any:
    from robovast.campaign.layout import Layout

    return Layout(campaign)


def test_a_failure_map_from_metrics_without_code(tmp_path: Path) -> None:
    extra = """\
  strategy: boundary
  strategy_parameters: {initial: 2}
  extract:
    metrics:
      height: {table: out, column: y, over_time: max, over_runs: mean}
      asked: {sql: "SELECT config, max(y) AS y FROM out GROUP BY config"}
  objectives: [{name: failure_rate}]
  per_batch: 2
  budget: [{batches: 2}]
"""
    summary, recorder = search(tmp_path, extra)
    assert summary.report is not None, recorder.messages
    assert len(summary.report.evaluations) == 4, recorder.messages
    for evaluation in summary.report.evaluations:
        x = evaluation.params.values["x"]
        assert evaluation.measures["height"] == evaluation.measures["asked"] == x
    assert 0 <= summary.report.extra["failing_low"] <= summary.report.extra["failing_high"] <= 1

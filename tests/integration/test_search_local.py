"""Searches as plain processes: end to end, continued after any death, and what goes wrong."""

from __future__ import annotations

import json
import os
import sys
from contextlib import suppress
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
from support.terminal import shown_on_terminal

from robovast.base.errors import InputError, StorageError
from robovast.base.locks import exclusive_folder
from robovast.campaign.layout import Layout
from robovast.execution.local import LocalOptions
from robovast.execution.local.session import Session
from robovast.model.document import load_document
from robovast.model.packs import RUNS_LIMIT
from robovast.model.plan import Run
from robovast.search import batches
from robovast.search import local as search_local
from robovast.search.history import SearchHistory
from robovast.search.local import SearchSummary, execute_document, resume
from robovast.search.plugins import make_strategy

RANDOM = at_random(3)


def test_random_search_end_to_end(tmp_path: Path) -> None:
    summary, recorder = run_searched(tmp_path, RANDOM, runs=2)
    assert summary.stop is not None
    assert (summary.stop.kind, summary.total, len(summary.records)) == ("batches", 12, 12)
    assert summary.report is not None
    worst = max(values["x"] for batch in proposed_values(summary.campaign) for values in batch)
    assert summary.report.best is not None
    assert (summary.report.best.objectives["failure_rate"] == 1.0) is (worst >= 50)
    for set_id, objective, samples, params in stored_rows(
        summary.campaign, "SELECT config_name, objective, n_samples, params_json FROM unit"
    ):
        assert (summary.campaign / set_id / "1" / "run.json").is_file()
        assert (objective, samples) == (float(json.loads(params)["x"] >= 50), 2)
    campaign_row = stored_rows(summary.campaign, "SELECT mode, stop_kind, batches FROM campaign")
    assert campaign_row == [("search", "batches", 3)]
    scored = [message[:30] for message in recorder.messages if " is scored: " in message]
    assert scored == [f"batch {number} is scored: batches {number + 1}/3" for number in range(3)]
    again = resume(summary.campaign, LocalOptions(runtime="process"), Recorder())
    assert again.total == 12, "a budget that is spent leaves nothing to do"


STORE = {
    "campaign": {
        "id": "integer", "name": "text", "mode": "text", "config_dir": "text",
        "config_json": "text", "created_at": "real", "strategy_state": "null",
        "stop_kind": "text", "stop_reason": "text", "batches": "integer", "elapsed_s": "real",
    },
    "batch": {
        "id": "integer", "campaign_id": "integer", "idx": "integer", "dir": "text",
        "created_at": "real",
    },
    "unit": {
        "id": "integer", "batch_id": "integer", "paramset_id": "text", "config_name": "text",
        "params_json": "text", "objective": "real", "objectives_json": "text",
        "measures_json": "text", "n_samples": "integer", "status": "text", "result_dir": "text",
        "created_at": "real",
    },
}  # fmt: skip
"""Columns of `campaign.db`, and the types of their values when a search has ended."""


class Reads(Recorder):
    """Reads the store whenever it is told that a batch is scored."""

    def __init__(self, out: Path) -> None:
        super().__init__()
        self.out = out
        self.seen: list[tuple[int, int, str | None]] = []

    def message(self, text: str) -> None:
        super().message(text)
        if text.startswith("batch "):
            (campaign,) = self.out.iterdir()
            query = (
                "SELECT batches, (SELECT count(*) FROM unit), stop_kind FROM campaign, "
                "(SELECT max(idx) AS last FROM batch) WHERE last = batches - 1"
            )
            self.seen += stored_rows(campaign, query)


def test_the_store_is_complete_at_each_end_of_a_batch(tmp_path: Path) -> None:
    path = make_campaign(tmp_path, FAILS_ABOVE_50, RANDOM, document=DOCUMENT)
    reader = Reads(tmp_path / "out")
    options = LocalOptions(runtime="process")
    campaign = execute_document(load_document(path), tmp_path / "out", options, reader).campaign
    assert reader.seen == [(1, 2, None), (2, 4, None), (3, 6, None)]
    assert stored_rows(campaign, "PRAGMA user_version") == [(1,)]
    for table, columns in STORE.items():
        listed = stored_rows(campaign, f"PRAGMA table_info({table})")
        assert [name for _, name, *_ in listed] == list(columns)
        typed = ", ".join(f"typeof({name})" for name in columns)
        types = stored_rows(campaign, f"SELECT {typed} FROM {table}")  # noqa: S608
        assert set(types) == {tuple(columns.values())}
    row = "SELECT name, mode, config_dir, stop_kind, batches FROM campaign"
    assert stored_rows(campaign, row) == [(campaign.name, "search", "_config", "batches", 3)]
    assert stored_rows(campaign, "SELECT idx, dir FROM batch") == [(0, "."), (1, "."), (2, ".")]
    query = "SELECT paramset_id, config_name, params_json, status, result_dir, batch.idx "
    query += "FROM unit JOIN batch ON batch.id = unit.batch_id"
    for set_id, config, params, status, folder, batch in stored_rows(campaign, query):
        assert json.loads(params) in proposed_values(campaign)[batch]
        assert (config, folder, status) == (f"c{set_id}", f"c{set_id}", "evaluated")
        assert (campaign / folder / "0" / "run.json").is_file()


def test_a_store_that_lacks_a_batch_is_completed_when_the_search_goes_on(tmp_path: Path) -> None:
    """Who is killed between the two files has scored a batch that the store does not know."""
    summary, _ = run_searched(tmp_path, RANDOM)
    (summary.campaign / "campaign.db").unlink()
    resume(summary.campaign, LocalOptions(runtime="process"), Recorder())
    assert stored_rows(summary.campaign, "SELECT batches FROM campaign") == [(3,)]


class Edits(Recorder):
    """Changes the user's script at the end of a batch; keeps what the campaign has of it."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.folder = folder
        self.kept: dict[int, str] = {}

    def message(self, text: str) -> None:
        super().message(text)
        if text.startswith("batch "):
            (self.folder / "files/step.sh").write_text("exit 0\n")
            (own,) = self.folder.glob("out/*/_config/files/step.sh")
            self.kept[own.stat().st_ino] = own.read_text()


def test_a_search_keeps_the_files_that_it_began_with(tmp_path: Path) -> None:
    """Neither an edit nor a kill while a batch is written changes what later runs execute."""
    path = make_campaign(tmp_path, FAILS_ABOVE_50, RANDOM, document=DOCUMENT)
    edits = Edits(tmp_path)
    execute_document(load_document(path), tmp_path / "out", LocalOptions(runtime="process"), edits)
    assert list(edits.kept.values()) == [FAILS_ABOVE_50], "written once, so never half"


def test_an_ended_search_goes_on_with_more_batches(tmp_path: Path) -> None:
    stopping = "  stopping: [{target_objective: 0.0}]\n"
    summary, _ = run_searched(tmp_path, RANDOM + stopping)
    assert summary.stop is not None
    assert (summary.stop.kind, len(proposed_values(summary.campaign))) == ("target_objective", 1)
    again = resume(summary.campaign, LocalOptions(runtime="process", batches=4), Recorder())
    assert isinstance(again, SearchSummary)
    assert again.stop is not None
    assert (again.stop.reason, again.total) == ("batches: batches 4/4", 8)
    whole, _ = run_searched(tmp_path / "whole", RANDOM.replace("3}", "4}"))
    assert proposed_values(summary.campaign) == proposed_values(whole.campaign)
    later = resume(summary.campaign, LocalOptions(runtime="process"), Recorder())
    assert (later.total, len(proposed_values(summary.campaign))) == (8, 4), (
        "as it was told the last time"
    )
    with pytest.raises(InputError, match=r"has 4 batches, .* Use a number greater than 4"):
        resume(summary.campaign, LocalOptions(runtime="process", batches=4), Recorder())


def extended_before_the_lock(campaign: Path, patch: pytest.MonkeyPatch) -> None:
    """Has another program go on until batch 3 while the next one waits for the campaign."""
    own = search_local.continued_session

    def after_another(*args: Any) -> Session:
        with patch.context() as before:
            before.setattr(search_local, "continued_session", own)
            resume(campaign, LocalOptions(runtime="process", batches=3), Recorder())
        return own(*args)

    patch.setattr(search_local, "continued_session", after_another)


def test_a_search_ends_where_another_program_was_told_before_it_had_the_lock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    summary, _ = run_searched(tmp_path, at_random(1))
    extended_before_the_lock(summary.campaign, monkeypatch)
    later = resume(summary.campaign, LocalOptions(runtime="process"), Recorder())
    assert isinstance(later, SearchSummary)
    assert later.stop is not None
    assert later.stop.reason == "batches: batches 3/3"


def test_fewer_batches_than_another_program_has_done_before_the_lock_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    summary, _ = run_searched(tmp_path, at_random(1))
    extended_before_the_lock(summary.campaign, monkeypatch)
    with pytest.raises(InputError, match=r"has 3 batches, .* Use a number greater than 3"):
        resume(summary.campaign, LocalOptions(runtime="process", batches=2), Recorder())
    assert search_local.recorded_batches(_layout(summary.campaign)) == 3


def test_what_is_refused_changes_nothing(tmp_path: Path) -> None:
    summary, _ = run_searched(tmp_path, at_random(1))
    record = summary.campaign / "_execution" / "execution.yaml"
    before = record.read_text()
    with (
        exclusive_folder(Layout(summary.campaign).running, ""),
        pytest.raises(StorageError, match="another `vast` is running this campaign"),
    ):
        resume(summary.campaign, LocalOptions(runtime="process", batches=9), Recorder())
    assert record.read_text() == before


def test_more_runs_than_a_campaign_can_have_are_refused_before_there_is_one(
    tmp_path: Path,
) -> None:
    with pytest.raises(InputError, match=r"runs, more than 10,000,000"):
        run_searched(tmp_path, RANDOM, runs=RUNS_LIMIT)
    assert not (tmp_path / "out").exists()


def test_what_has_no_effect_in_a_search_that_goes_on_is_said(tmp_path: Path) -> None:
    summary, _ = run_searched(tmp_path, at_random(1))
    name = next(iter(SearchHistory(Layout(summary.campaign)).configs().values()))
    recorder = Recorder()
    options = LocalOptions(runtime="process", select=[name], runs=9, abort_on_failure=True)
    resume(summary.campaign, options, recorder)
    assert recorder.started == []
    assert [text for text in recorder.messages if text.startswith("--")] == [
        "--config has no effect in a search.",
        "--abort-on-failure has no effect in a search.",
        "--runs has no effect, because the search has ended; also set `--batches`.",
    ]


def test_batches_belong_to_searches_alone(tmp_path: Path) -> None:
    path = make_campaign(tmp_path, "true\n")
    options = LocalOptions(runtime="process", batches=2)
    with pytest.raises(InputError, match="has no `search`"):
        execute_document(load_document(path), tmp_path / "out", options, Recorder())
    summary, _ = run_searched(tmp_path / "one", RANDOM, batches=1)
    assert len(proposed_values(summary.campaign)) == 1


PLUGINS = '''\
import sys
from pathlib import Path

from robovast.search.extractor import Extractor, ExtractResult, completed_run_dirs
from robovast.search.strategy import SearchStrategy
from robovast.search.types import ParamSet, SearchReport


class Odd(Extractor):
    """Fails for one set, gives nan for another, and leaves the objective of a third out."""

    def extract(self, config_dir: Path):
        (value, *_) = {int(run.joinpath("out.csv").read_text().split(",")[-1])
                       for run in completed_run_dirs(config_dir)}
        if value == 60:
            raise SystemExit("no 60s")
        if value == 30:
            return ExtractResult({"other": 1.0})
        return ExtractResult({"score": float("nan") if value == 10 else value * self.params["by"]})


class Three(SearchStrategy):
    def ask(self, n):
        return [ParamSet({"x": x}) for x in (10, 60, 30, 3)]

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


def test_errors_of_an_extractor_are_the_sets_and_the_search_goes_on(tmp_path: Path) -> None:
    with_plugins(tmp_path)
    extra = """\
  strategy: ./plugins.py:Three
  extract: {plugin: ./plugins.py:Odd, params: {by: 2}}
  objectives: [{name: score, direction: minimize}]
  per_batch: 4
  budget: [{batches: 1}]
"""
    summary, recorder = run_searched(tmp_path, extra)
    assert summary.report is not None
    assert summary.report.extra["seen"] == [6.0]
    told = " ".join(recorder.messages)
    assert "SystemExit: no 60s" in told
    assert "`score` must be a finite number, not nan" in told
    assert "the objective `score` is missing; there are: other" in told
    scores = SearchHistory(_layout(summary.campaign)).scores()
    assert sum("no 60s" in score.trace for score in scores.values()) == 1
    status = "SELECT status FROM unit ORDER BY status"
    assert stored_rows(summary.campaign, status) == [*[("errored",)] * 3, ("evaluated",)]


def test_a_terminal_says_what_takes_its_time(tmp_path: Path) -> None:
    with_plugins(tmp_path)
    plugins = tmp_path / "plugins.py"
    plugins.write_text(f"import time\ntime.sleep(2)\n{plugins.read_text()}")
    own = "strategy: ./plugins.py:Leaves\n  strategy_parameters: {at: never}"
    summary, _ = run_searched(tmp_path, at_random(1).replace("strategy: random", own))
    vast = Path(sys.executable).with_name("vast")
    listing = [vast, "-V", tmp_path / "test.vast", "config", "list"]
    code, shown = shown_on_terminal(listing, tmp_path)
    assert (code, "\rReading test.vast … " in shown.replace("\x1b[K", "")) == (0, True), shown
    code, shown = shown_on_terminal([vast, "results", "search", summary.campaign], tmp_path)
    told = f"\rReading {summary.campaign.name} … "
    assert (code, told in shown.replace("\x1b[K", "")) == (0, True), shown


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
        run_searched(tmp_path, extra)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("method", ["ask", "tell", "is_done", "report"])
def test_a_strategy_that_ends_the_process_is_one_clear_error(tmp_path: Path, method: str) -> None:
    with_plugins(tmp_path)
    extra = RANDOM.replace("strategy: random", "strategy: ./plugins.py:Leaves")
    extra += f"  strategy_parameters: {{at: {method}}}\n"
    with pytest.raises(InputError, match=rf"`{method}` raised SystemExit: enough \(.*plugins.py:"):
        run_searched(tmp_path, extra)


def test_fewer_sets_than_asked_and_numbers_that_are_none_do_no_harm(tmp_path: Path) -> None:
    with_plugins(tmp_path)
    extra = RANDOM.replace("strategy: random", "strategy: ./plugins.py:Leaves")
    extra += "  strategy_parameters: {at: never}\n"
    summary, _ = run_searched(tmp_path, extra)
    assert len(summary.records) == 1
    batches = SearchHistory(_layout(summary.campaign)).batches
    assert [dict(batch.outcome.metrics) for batch in batches if batch.outcome] == [{"fine": 1}] * 3


NONE = """\
from robovast.common.variation import Variation


class Nothing(Variation):
    def variation(self, in_configs):
        return []
"""


@pytest.mark.parametrize(
    ("variation", "said"),
    [
        (
            "ParameterVariationList: {name: x, values: [$x, 3]}",
            "create 2 configurations of the parameter set",
        ),
        ("none.py:Nothing: {}", "`none.py:Nothing` created no configuration"),
    ],
)
def test_a_template_that_makes_none_or_several_configurations_is_refused(
    tmp_path: Path, variation: str, said: str
) -> None:
    (tmp_path / "none.py").write_text(NONE)
    extra = f"{RANDOM}  variations: [{{{variation}}}]\n"
    with pytest.raises(InputError, match=said):
        run_searched(tmp_path, extra)
    assert not (tmp_path / "out").exists()


def test_a_space_of_one_point_is_run_once(tmp_path: Path) -> None:
    document = DOCUMENT.replace("low: 0, high: 100", "low: 7, high: 7")
    summary, _ = run_searched(tmp_path, RANDOM, document=document)
    assert summary.stop is not None
    assert (summary.stop.kind, len(summary.records)) == ("exhausted", 1)


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
    summary, recorder = run_searched(tmp_path, extra)
    assert summary.report is not None, recorder.messages
    assert len(summary.report.evaluations) == 4, recorder.messages
    for evaluation in summary.report.evaluations:
        x = evaluation.params.values["x"]
        assert evaluation.measures["height"] == evaluation.measures["asked"] == x
    assert 0 <= summary.report.extra["failing_low"] <= summary.report.extra["failing_high"] <= 1


WAITS = """\
if [ "$1" = {x} ]; then
  for _ in $(seq 3000); do [ -e "$3/go" ] && exit 0; sleep 0.1; done
  exit 1
fi
"""


class Releases(Recorder):
    """Lets a run end when so many have begun."""

    def __init__(self, out: Path, begun: int) -> None:
        super().__init__()
        self.out = out
        self.begun = begun

    def run_started(self, run: Run) -> None:
        super().run_started(run)
        if len(self.started) == self.begun:
            for out in self.out.glob("*/.running/*/out"):
                for folder, *_ in os.walk(out):
                    with suppress(FileNotFoundError):  # that run has just ended
                        Path(folder, "go").touch()


@pytest.mark.parametrize(("enough", "ahead"), [(3, [0, 0, 1, 2, 2]), (2, [0, 0, 1, 1, 1])])
def test_batches_are_asked_further_ahead_until_runs_are_enough_for_any_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, enough: int, ahead: list[int]
) -> None:
    """However many runs are executed side by side, the sets are the same."""
    monkeypatch.setattr(batches, "ENOUGH", enough)
    found = {}
    for jobs in (1, 3):
        summary, _ = run_searched(tmp_path / str(jobs), at_random(5), jobs=jobs)
        history = SearchHistory(_layout(summary.campaign)).batches
        assert [batch.proposal.ahead for batch in history] == ahead
        found[jobs] = proposed_values(summary.campaign)
    assert found[1] == found[3]


def test_batches_that_fill_the_space_do_not_wait_for_the_first_one(tmp_path: Path) -> None:
    """However many runs are executed side by side, the sets are the same."""
    extra = at_random(5).replace("strategy: random", "strategy: boundary")
    extra += "  strategy_parameters: {initial: 5}\n"
    found = {}
    for jobs in (1, 3):
        summary, _ = run_searched(tmp_path / str(jobs), extra, jobs=jobs)
        history = SearchHistory(_layout(summary.campaign)).batches
        assert [batch.proposal.ahead for batch in history] == [0, 1, 1, 2, 2]
        assert [batch.proposal.told for batch in history] == [0, 0, 2, 2, 4]
        found[jobs] = proposed_values(summary.campaign)
    assert found[1] == found[3]


def test_workers_begin_the_next_batch_before_the_last_run_of_this_one_ends(tmp_path: Path) -> None:
    """A run of the second batch passes if one of the third begins meanwhile."""
    path = make_campaign(tmp_path, "", RANDOM, document=DOCUMENT)
    made = make_strategy(load_document(path))
    _, (slow, _) = made.ask(2), made.ask(2)
    (tmp_path / "files/step.sh").write_text(WAITS.format(x=slow.values["x"]))
    recorder = Releases(tmp_path / "out", 5)
    options = LocalOptions(runtime="process", jobs=2)
    summary = execute_document(load_document(path), tmp_path / "out", options, recorder)
    assert {record.verdict.value for record in summary.records} == {"passed"}
    assert len(summary.records) == 6
    ahead = [b.proposal.ahead for b in SearchHistory(_layout(summary.campaign)).batches]
    assert ahead == [0, 0, 1]

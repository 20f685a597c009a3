"""The list of a campaign's runs is right at any time, and reads again only what changed."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from support.campaigns.stored import NAME, write, write_campaign, write_run

from robovast.base.errors import InputError
from robovast.campaign.verdict import Verdict
from robovast.evaluation import stored_runs
from robovast.evaluation.campaign_index import CampaignIndex
from robovast.evaluation.campaigns import find_campaigns
from robovast.evaluation.columns import columns
from robovast.evaluation.library import Library
from robovast.evaluation.server.answers import Data


def judge(parameters, number) -> str:
    return "failed" if parameters["speed"] > 1 and number == 0 else "passed"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return write_campaign(tmp_path, judge=judge, outputs=False)


@pytest.fixture
def index(root: Path) -> CampaignIndex:
    index = CampaignIndex(root.parent, NAME)
    index.refresh()
    return index


def test_a_summary_counts_the_runs(index: CampaignIndex) -> None:
    summary = index.summary()
    assert (summary.state, summary.planned, summary.variants) == ("finished", 4, 2)
    assert summary.counts[Verdict.PASSED] == 3
    assert summary.counts[Verdict.FAILED] == 1
    assert summary.duration == pytest.approx(60 + 5 + 10 * (3 * 0.618 % 1))


def test_it_says_how_many_configurations_are_read(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = Library(root.parent)
    said = []
    read = stored_runs.read_variant

    def reading(*place):
        said.append(library.reading())
        return read(*place)

    monkeypatch.setattr("robovast.evaluation.campaign_index.read_variant", reading)
    library.campaign(NAME)
    assert said == [{NAME: (0, 2)}, {NAME: (1, 2)}]
    assert library.reading() == {}


def test_what_is_read_so_far_is_there_before_the_rest(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = Library(root.parent)
    begun = []
    read = stored_runs.read_variant

    def reading(*place):
        index = library.begun(NAME)
        assert index is not None
        summary, variants = index.begun()
        begun.append((summary.planned, [len(variant.runs) for variant in variants]))
        return read(*place)

    monkeypatch.setattr("robovast.evaluation.campaign_index.read_variant", reading)
    assert library.begun(NAME) is None, "nothing is being read"
    library.campaign(NAME)
    assert begun == [(0, []), (2, [2])]
    assert library.begun(NAME) is None, "all is read"


def test_nothing_new_is_no_change(index: CampaignIndex) -> None:
    assert not index.refresh()
    assert index.version == 1


def test_a_run_that_is_stored_appears(root: Path, index: CampaignIndex) -> None:
    write_run(root, "hall-1", 2, 4, {"speed": 1.0}, judge, outputs=False)
    assert index.refresh()
    assert [run.number for run in index.variants[0].runs] == [0, 1, 2]


def test_only_variants_that_changed_are_read_again(
    root: Path, index: CampaignIndex, monkeypatch: pytest.MonkeyPatch
) -> None:
    for variant in ("hall-1", "hall-2"):
        os.utime(root / variant, (1, 1))  # long ago
    index.refresh()
    read = []
    original = stored_runs._read_record
    monkeypatch.setattr(
        stored_runs, "_read_record", lambda *args: read.append(args) or original(*args)
    )
    write_run(root, "hall-2", 2, 4, {"speed": 2.0}, judge, outputs=False)
    assert index.refresh()
    assert len(read) == 3


def test_a_campaign_runs_as_long_as_its_lock_is_held(root: Path, index: CampaignIndex) -> None:
    shutil.rmtree(root / "hall-2" / "1")
    write(root / ".running" / "lock", "")
    with (root / ".running" / "lock").open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert index.refresh()
        assert index.summary().state == "running"
        write(root / ".running" / "job-10" / "console.log", "")
        write(root / ".running" / "job-9" / "console.log", "")
        write(root / "_jobs" / "job-9" / "logs" / "system.log", "")
        assert index.refresh()
        assert [(job.name, job.log) for job in index.active or ()] == [
            ("job-9", f"{NAME}/_jobs/job-9/logs/system.log"),
            ("job-10", f"{NAME}/.running/job-10/console.log"),
        ]
    assert index.refresh()
    assert index.summary().state == "incomplete"


def test_of_a_mirrored_campaign_those_jobs_go_on_whose_logs_are_new_and_runs_not_all_there(
    root: Path, index: CampaignIndex
) -> None:
    def job(name: str, claim: str, age: float = 0) -> None:
        write(root / "_transient" / f"{name}.params.yaml", claim)
        write(root / "_jobs" / name / "logs" / "system.log", "")
        then = time.time() - age
        os.utime(root / "_jobs" / name / "logs" / "system.log", (then, then))

    records = [json.loads(path.read_text()) for path in root.glob("*/*/run.json")]
    ended = Counter(record["job"] for record in records)
    for name, runs in ended.items():
        job(name, f"# attempt 1, runs 0-{runs - 1}, executed by pod-1 a\n")
    job("job-10", "# attempt 1, runs 40,42-43, executed by pod-2 b\n")
    job("job-9-2", "# attempt 1, runs 9, executed by pod-3 c\n")
    job("job-8", "# attempt 1, runs 8, executed by pod-4 d\n", age=3600)
    job("job-7", "\x00")
    index.refresh()
    assert index.active is None, "they are not of a cluster"
    write(root / ".bucket", "robovast-lab")
    index.refresh()
    assert [(job.name, job.log) for job in index.active or ()] == [
        (name, f"{NAME}/_jobs/{name}/logs/system.log") for name in ("job-7", "job-9-2", "job-10")
    ]
    assert index.summary().state == "running"
    for name in ("job-7", "job-9-2", "job-10"):
        os.utime(root / "_jobs" / name / "logs" / "system.log", (1, 1))
    index.refresh()
    assert index.active is None


def test_an_interrupted_run_leaves_a_campaign_incomplete(tmp_path: Path) -> None:
    write_campaign(tmp_path, judge=lambda *_: "interrupted", outputs=False)
    index = CampaignIndex(tmp_path, NAME)
    index.refresh()
    assert index.summary().state == "incomplete"


def test_results_without_records_are_read_from_their_test_results(tmp_path: Path) -> None:
    root = write_campaign(tmp_path)
    for record in root.rglob("run.json"):
        record.unlink()
    write(root / "hall-1" / "_config" / "scenario.config", "drive:\n  speed: 1.5\n")
    index = CampaignIndex(tmp_path, NAME)
    index.refresh()
    first = index.variants[0]
    assert first.parameters == {"speed": 1.5}
    assert first.runs[0].verdict is Verdict.FAILED
    assert "no goal after 20 s" in first.runs[0].reason


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"verdict": ["passed"]}', "[" * 9999])
def test_a_record_that_cannot_be_read_is_an_errored_run(root: Path, content: str) -> None:
    write(root / "hall-1" / "0" / "run.json", content)
    index = CampaignIndex(root.parent, NAME)
    index.refresh()
    assert index.variants[0].runs[0].verdict is Verdict.ERRORED


def test_links_and_pipes_are_not_read(root: Path, tmp_path: Path) -> None:
    elsewhere = write_campaign(tmp_path / "elsewhere", outputs=False)
    (root / "linked").symlink_to(elsewhere / "hall-1")
    (root / "hall-1" / "7").symlink_to(elsewhere / "hall-1" / "0")
    (root / "hall-2" / "7").mkdir()
    (root / "hall-2" / "7" / "run.json").symlink_to(elsewhere / "hall-1" / "0" / "run.json")
    (root / "hall-2" / "8").mkdir()
    os.mkfifo(root / "hall-2" / "8" / "run.json")
    os.mkfifo(root / "hall-2" / "8" / "test.xml")
    index = CampaignIndex(root.parent, NAME)
    index.refresh()
    assert [variant.name for variant in index.variants] == ["hall-1", "hall-2"]
    assert [run.number for run in index.variants[0].runs] == [0, 1]
    assert [run.verdict for run in index.variants[1].runs[2:]] == [Verdict.ERRORED] * 2


@pytest.mark.parametrize("time", ["nan", "inf", "-1", "1e400", "9" * 400])
def test_times_that_are_none_are_left_out(root: Path, time: str) -> None:
    """As JSON, which has no such numbers, the answer could not be written."""
    suite = f'<testsuite time="{time}"><testcase/></testsuite>'
    write(root / "hall-1" / "0" / "test.xml", suite)
    (root / "hall-1" / "0" / "run.json").unlink()
    record = json.loads((root / "hall-1" / "1" / "run.json").read_text())
    text = json.dumps({**record, "duration": "TIME"}).replace(
        '"TIME"', time.replace("inf", "1e999")
    )
    write(root / "hall-1" / "1" / "run.json", text.replace("nan", "NaN"))
    index = CampaignIndex(root.parent, NAME)
    index.refresh()
    assert Data(columns(index.variants)).body
    first, second = index.variants[0].runs
    assert (first.verdict, first.duration) == (Verdict.PASSED, None)
    too_large = len(time) > 300  # for a number of seconds, so that the record is not understood
    assert second.verdict is (Verdict.ERRORED if too_large else Verdict.PASSED)
    assert second.duration in {None, -1.0}
    assert index.summary().duration is not None


def test_campaigns_are_found_newest_first(tmp_path: Path) -> None:
    for name in ("b-2026-01-01-000000", "a-2026-01-02-000000"):
        write_campaign(tmp_path, name, outputs=False)
    (tmp_path / "notes").mkdir()
    (tmp_path / "linked").symlink_to(tmp_path / "b-2026-01-01-000000")
    assert find_campaigns(tmp_path) == ["a-2026-01-02-000000", "b-2026-01-01-000000"]


def test_variants_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    write_campaign(tmp_path, variants=[{"speed": i} for i in range(11)], runs=1, outputs=False)
    index = CampaignIndex(tmp_path, NAME)
    index.refresh()
    assert [variant.name for variant in index.variants][8:] == ["hall-9", "hall-10", "hall-11"]


def test_columns_say_the_same_as_the_runs(index: CampaignIndex) -> None:
    found = columns(index.variants)
    assert found.variants.values == {"speed": [1.0, 2.0]}
    assert found.runs.variant == [0, 0, 1, 1]
    verdicts = [found.verdicts[code] for code in found.runs.verdict]
    assert verdicts == ["passed", "passed", "failed", "passed"]
    reason = found.runs.reason[2]
    assert found.reasons[reason] == "goal not reached: no goal after 20 s"
    assert found.causes[found.cause[reason]] == "goal not reached: no goal after 20 s"


def test_a_column_in_which_runs_differ_is_sent_with_each_text_once(index: CampaignIndex) -> None:
    (first, second), others = index.variants[0].runs, index.variants[1:]
    runs = (replace(first, host="one"), replace(second, host="two"))
    found = columns([replace(index.variants[0], runs=runs), *others]).runs.texts["host"]
    assert [found.texts[place] for place in found.text][:2] == ["one", "two"]
    assert len(found.texts) == len(set(found.texts))
    same = [replace(one, runs=tuple(replace(r, host="one") for r in one.runs)) for one in others]
    assert columns(same).runs.texts == {}


def test_a_test_ends_the_runs_of_a_configuration(root: Path) -> None:
    decide = "decide: {min: 1, good: 0.1, bad: 0.6, error: 0.4}"
    write(root / "_execution" / "execution.yaml", f"runs: 7\n{decide}\n")
    index = CampaignIndex(root.parent, NAME)
    index.refresh()
    summary = index.summary()
    assert columns(index.variants, summary.test).decided == [
        "passing after 2",
        "failing after 1",
    ]
    assert (summary.planned, summary.state) == (4, "finished")
    write(root / "_execution" / "execution.yaml", "runs: 7\ndecide: {good: 3}\n")
    index.refresh()
    assert (index.summary().planned, index.summary().test) == (14, None)


def test_a_folder_without_runs_and_inputs_is_no_configuration(
    root: Path, index: CampaignIndex
) -> None:
    before = index.summary()
    write(root / "maps" / "hall.yaml", "image: hall.pgm\n")
    index.refresh()
    assert index.summary() == before


def test_names_that_a_page_cannot_show_are_left_out(root: Path) -> None:
    os.mkdir(os.fsencode(root) + b"/broken\xff")
    (root / "\u00b2-\u0663" / "_config").mkdir(parents=True)
    index = CampaignIndex(root.parent, NAME)
    index.refresh()
    assert {variant.name for variant in index.variants} == {"hall-1", "hall-2", "\u00b2-\u0663"}


def test_a_library_says_why_a_campaign_cannot_be_read(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: Path) -> None:
        raise PermissionError(13, "Permission denied")

    library = Library(root.parent)
    monkeypatch.setattr("robovast.evaluation.campaign_index.os.scandir", refuse)
    with pytest.raises(InputError, match="Permission denied"):
        library.summary(NAME)
    assert library.known(NAME) == (None, f"{NAME} cannot be read: Permission denied.")
    monkeypatch.undo()
    assert library.summary(NAME).planned == 4
    assert library.known(NAME)[1] == ""


def test_a_library_forgets_campaigns_that_are_gone(root: Path) -> None:
    library = Library(root.parent)
    assert library.summary(NAME) is not None
    shutil.rmtree(root)
    assert library.names() == []
    with pytest.raises(InputError):
        library.summary(NAME)


@pytest.mark.parametrize("name", ["..", ".", "", f"{NAME}/hall-1", f"../results/{NAME}"])
def test_only_a_folder_of_the_results_is_a_campaign(root: Path, name: str) -> None:
    with pytest.raises(InputError):
        Library(root.parent).summary(name)


def test_what_was_varied_is_read_from_runs_and_before_the_first_one(tmp_path: Path) -> None:
    factors = {"clutter": {"value": 0.25, "unit": "1/m"}, "broken": 7}
    root = write_campaign(tmp_path, runs=1, outputs=False, factors=lambda _: factors)
    write(root / "hall-3" / "_config" / "scenario.config", "drive: {speed: 3.0}\n")
    text = "config_identifier: abc\nfactors: {clutter: {value: 0.5, unit: 1/m}}\n"
    write(root / "hall-3" / "_config" / "config.yaml", text)
    found = Library(tmp_path).campaign(NAME).variants
    assert [variant.factors for variant in found] == [
        {"clutter": 0.25},
        {"clutter": 0.25},
        {"clutter": 0.5},
    ]
    assert found[2].units == {"clutter": "1/m"}


def test_parameters_stand_for_factors_of_older_campaigns(index: CampaignIndex) -> None:
    assert [variant.factors for variant in index.variants] == [{"speed": 1.0}, {"speed": 2.0}]

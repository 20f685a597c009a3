"""`--reuse`: runs that another campaign has executed with equal inputs are taken over."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import pytest
from support.campaigns.local import Recorder, make_campaign, run, verdicts

from robovast.analysis.tables.runs import run_rows
from robovast.campaign.imported import mark_imported
from robovast.campaign.junit import merged_suites
from robovast.campaign.layout import Layout
from robovast.execution.local import ExecutionSummary

VAST = Path(sys.executable).with_name("vast")
SCRIPT = 'echo "$1,$ROBOVAST_SEED" > "$3/out.csv"\n[ "$1" != 2 ]\n'
SEED = "  seed: 7\n"


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of a campaign of three configurations, of which `one-2` fails."""
    folder = tmp_path_factory.mktemp("executed")
    run(make_campaign(folder / "in", SCRIPT, SEED), folder / "out")
    return folder


@pytest.fixture
def first(executed: Path, tmp_path: Path) -> Path:
    """A copy of that campaign."""
    shutil.copytree(executed, tmp_path / "copy", symlinks=True)
    (campaign,) = (tmp_path / "copy" / "out").iterdir()
    return campaign


def again(first: Path, **options: object) -> tuple[ExecutionSummary, Recorder]:
    """Another campaign of the same results folder, which reuses runs."""
    told = Recorder()
    return run(
        first.parents[1] / "in" / "test.vast", first.parent, told, reuse=True, **options
    ), told


def reused(summary: ExecutionSummary) -> dict[str, str]:
    return {f"{r.variant}/{r.run}": r.reused_from for r in summary.records}


def content(folder: Path) -> dict[str, str]:
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path): sha256(path.read_bytes()).hexdigest() for path in files}


def test_equal_runs_are_taken_over_with_files_job_and_origin(first: Path) -> None:
    before = content(first)
    second, told = again(first)
    assert told.started == []
    assert told.messages == ["Reused 3 of 3 runs."]
    name = first.name
    assert reused(second) == {f"one-{n}/0": f"{name}/one-{n}/0" for n in (1, 2, 3)}
    assert list(verdicts(second).values()) == ["passed", "failed", "passed"]
    for n in (1, 2, 3):
        folder, origin = second.campaign / f"one-{n}" / "0", first / f"one-{n}" / "0"
        assert (folder / "out.csv").read_text() == (origin / "out.csv").read_text()
        record = json.loads((folder / "run.json").read_text())
        assert (record["campaign"], record["id"]) == (second.campaign.name, n - 1)
        assert (folder / "job" / "logs" / "system.log").is_file()
    assert content(first) == before
    assert not any(suite.properties for suite in merged_suites(Layout(first)))
    third = shutil.copytree(second.campaign, first.with_name("last"), symlinks=True)
    shutil.rmtree(first)
    shutil.rmtree(second.campaign)
    last, _ = again(third, select="one-1")
    assert reused(last) == {"one-1/0": f"{name}/one-1/0"}  # who executed it
    rows = run_rows(Layout(third), ["one-1/0"])
    assert [row["reused_from"] for row in rows] == [f"{name}/one-1/0"]
    assert [s.properties for s in merged_suites(Layout(third))] == [{"reused": "1 of 1"}] * 3


def test_what_was_edited_alone_is_executed_and_the_command_counts_the_others(first: Path) -> None:
    path = first.parents[1] / "in" / "test.vast"
    path.write_text(path.read_text().replace("[1, 2, 3]", "[1, 2, 4]"))
    command = [
        VAST,
        "-V",
        path,
        "exec",
        "local",
        "run",
        "--runtime",
        "process",
        "--reuse",
        first.parent,
    ]
    done = subprocess.run(command, cwd=first.parents[1], capture_output=True, text=True)
    assert f" s (reused from {first.name}/one-1/0)" in done.stdout
    assert "Reused 2 of 3 runs." in done.stdout
    assert "3 runs: 2 passed, 1 failed; reused 2 of 3." in done.stdout
    (second,) = (folder for folder in first.parent.iterdir() if folder != first)
    assert (second / "one-3/0/out.csv").read_text().startswith("4,")
    asked = [VAST, "results", "summary", second]
    said = subprocess.run(asked, capture_output=True, text=True).stdout
    assert "0 errored, 0 interrupted; reused 2 of 3\n" in said


def test_runs_of_an_imported_campaign_are_not_reused(first: Path) -> None:
    mark_imported(first)
    _, told = again(first)
    assert told.messages == [
        "Reused 0 of 3 runs.",
        f"Not reused: {first.name}: the campaign was imported.",
    ]


def test_another_run_file_makes_all_work_other(first: Path) -> None:
    path = first.parents[1] / "in" / "files" / "step.sh"
    path.write_text(path.read_text() + "\n# other\n")
    second, told = again(first, select="one-1")
    assert told.started == ["one-1/0"]
    assert reused(second) == {"one-1/0": ""}


def test_nothing_is_reused_without_a_seed_of_the_user(tmp_path: Path) -> None:
    told = Recorder()
    run(make_campaign(tmp_path / "in", SCRIPT), tmp_path, told, select="one-1", reuse=True)
    (line,) = told.messages
    assert line.startswith("Nothing is reused: test.vast sets no `execution.seed`")
    assert told.started == ["one-1/0"]


def test_nothing_is_reused_in_an_environment_of_the_user(
    first: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from robovast.execution.local.process_environment import process_environment

    mine = tmp_path / "mine"
    mine.symlink_to(process_environment(print))
    monkeypatch.setenv("ROBOVAST_PROCESS_ENV", str(mine))
    second, told = again(first, select="one-1")
    assert "Nothing is reused: the contents of process:mine are unknown." in told.messages[0]
    assert second.records[0].key == ""


def test_what_cannot_be_trusted_is_executed_and_said(first: Path) -> None:
    one, two, three = (first / f"one-{n}/0" for n in (1, 2, 3))
    (one / "out.csv").write_text("1,2\n")
    (two / "run.json").write_text("{")
    record = json.loads((three / "run.json").read_text())
    (three / "run.json").write_text(json.dumps({**record, "verdict": "errored"}))
    _, told = again(first)
    assert sorted(told.started) == ["one-1/0", "one-2/0", "one-3/0"]
    name = first.name
    assert told.messages == [
        "Reused 0 of 3 runs.",
        f"Not reused: {name}/one-1/0: `out.csv` has changed since the run.",
        f"Not reused: {name}/one-2/0: its run.json is missing or damaged.",
        f"Not reused: {name}/one-3/0: it is errored, not passed or failed.",
    ]


def edit_record(run: Path, **changes: object) -> None:
    """Change keys of a run's record."""
    record = json.loads((run / "run.json").read_text())
    (run / "run.json").write_text(json.dumps({**record, **changes}))


def test_a_verdict_that_is_not_that_of_the_test_result_is_not_taken_over(first: Path) -> None:
    edit_record(first / "one-2/0", verdict="passed", reason="")
    second, told = again(first, select="one-2")
    assert list(verdicts(second).values()) == ["failed"]
    name = first.name
    assert told.messages == [
        "Reused 0 of 1 runs.",
        f"Not reused: {name}/one-2/0: it is passed, but failed by its test.xml.",
    ]


def test_a_reused_run_has_the_parameters_of_its_own_campaign(first: Path) -> None:
    edit_record(first / "one-1/0", parameters={"x": 99})
    second, _ = again(first, select="one-1")
    assert list(reused(second)) == ["one-1/0"]
    assert second.records[0].parameters == {"x": 1}


def test_without_key_or_checksums_a_run_is_executed_and_that_is_said(first: Path) -> None:
    for number, key in ((1, "key"), (2, "outputs")):
        path = first / f"one-{number}/0/run.json"
        record = json.loads(path.read_text())
        path.write_text(json.dumps({k: v for k, v in record.items() if k != key}))
    _, told = again(first)
    assert sorted(told.started) == ["one-1/0", "one-2/0"]
    said = "\n".join(told.messages)
    assert "one-1/0: it has no key (it was run by RoboVAST 1.x or on a cluster)." in said
    assert "one-2/0: it has no checksums" in said


def test_a_campaign_that_is_being_executed_is_left_alone(first: Path) -> None:
    running = first / ".running"
    running.mkdir()
    with (running / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        _, told = again(first, select="one-1")
    assert told.started == ["one-1/0"]
    name = first.name
    assert told.messages[1] == f"Not reused: {name}: the campaign is running."


def test_links_among_the_output_keep_a_run_from_being_reused(tmp_path: Path) -> None:
    script = 'ln -s /etc/passwd "$3/link"\n'
    done = run(make_campaign(tmp_path / "in", script, SEED), tmp_path / "out", select="one-1")
    assert done.records[0].outputs is None


def test_a_pack_is_reused_as_a_whole_or_not_at_all(tmp_path: Path) -> None:
    made = make_campaign(tmp_path / "in", SCRIPT, SEED + "  runs_per_job: 3\n")
    first = run(made, tmp_path / "out", runs=2).campaign
    second, told = again(first, runs=2)
    assert told.started == []
    assert {record.job for record in second.records} == {"job-0", "job-1"}
    (first / "one-1/1/out.csv").write_text("")
    shutil.rmtree(second.campaign)
    _, told = again(first, runs=2)
    assert told.started == ["one-1/0", "one-1/1", "one-2/0"]


def test_files_that_postprocessing_made_are_not_taken_over(first: Path) -> None:
    (first / "one-1/0/derived.csv").write_text("a\n")
    second, _ = again(first, select="one-1")
    assert sorted(os.listdir(second.campaign / "one-1/0")) == sorted(
        {*os.listdir(first / "one-1/0")} - {"derived.csv"}
    )

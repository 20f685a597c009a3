"""Each configuration is run until a test calls it passing or failing, whatever dies meanwhile."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from support.campaigns.local import AS_NEEDED as RULE
from support.campaigns.local import DECISIONS as SUMMED_UP
from support.campaigns.local import SOUND_BROKEN_MIXED as SCRIPT
from support.campaigns.local import Recorder, make_campaign, resume, run, verdicts
from support.pages import code_blocks
from support.patience import eventually

from robovast.analysis.provenance import write_graph, write_metadata

NEEDED = {
    "one-1/0": "passed",
    "one-1/1": "passed",
    "one-1/2": "passed",
    "one-2/0": "failed",
    "one-2/1": "failed",
    "one-3/0": "passed",
    "one-3/1": "failed",
    "one-3/2": "passed",
    "one-3/3": "failed",
}
DECIDED = {"one-1": "passing after 3", "one-2": "failing after 2", "one-3": "inconclusive at 4"}


HERE = ["--runtime", "process", "--jobs", "1"]


def vast(*words: str | Path, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    program = [Path(sys.executable).with_name("vast"), *words]
    return subprocess.run(program, capture_output=True, text=True, check=False, cwd=folder)


def page_commands() -> list[list[str]]:
    """What docs/how-to/sample-size.md types about runs as needed, without `vast`."""
    blocks = code_blocks("docs/how-to/sample-size.md", "bash")
    block = next(block for block in blocks if "vast config list" in block)
    return [shlex.split(line, comments=True)[1:] for line in block.splitlines()]


@pytest.mark.parametrize("per_job", [1, 3])
def test_each_configuration_has_the_runs_that_its_verdicts_need(
    tmp_path: Path, per_job: int
) -> None:
    recorder = Recorder()
    path = make_campaign(tmp_path / "in", SCRIPT, f"{RULE}  runs_per_job: {per_job}\n")
    summary = run(path, tmp_path / "out", recorder, jobs=1)
    assert verdicts(summary) == NEEDED
    assert recorder.decided == DECIDED
    assert (summary.total, summary.missing) == (12, 0)
    said = json.loads(vast("results", "summary", summary.campaign, "-o", "json").stdout)
    assert said["state"] == "finished"
    assert {c["name"]: c["decision"]["runs"] for c in said["configurations"]} == {
        "one-1": 3,
        "one-2": 2,
        "one-3": 4,
    }
    states = {"one-1": "sound", "one-2": "broken", "one-3": "undecided"}
    assert {c["name"]: c["state"] for c in said["configurations"]} == states
    metadata = yaml.safe_load(write_metadata(summary.campaign).read_text())
    described = {c["name"]: c["decision"]["state"] for c in metadata["configurations"]}
    assert described == states
    graph = json.loads(write_graph(summary.campaign).read_text())["@graph"]
    assert sorted(str(n["decision"]) for n in graph if "decision" in n) == sorted(states.values())


def test_workers_run_ahead_only_beside_what_is_needed(tmp_path: Path) -> None:
    recorder = Recorder()
    path = make_campaign(tmp_path / "in", SCRIPT, RULE)
    summary = run(path, tmp_path / "out", recorder, jobs=3)
    stored = verdicts(summary)
    assert NEEDED.items() <= stored.items()
    assert len(stored) <= len(NEEDED) + 2
    assert recorder.decided == DECIDED


def test_kill_9_and_resume_need_the_same_runs(tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", f'[ "$1" != 3 ] || sleep 600\n{SCRIPT}', RULE)
    words = ["--vast-file", path, "exec", "local", "run", tmp_path / "out"]
    words += ["--runtime", "process", "--jobs", "1"]
    process = subprocess.Popen([Path(sys.executable).with_name("vast"), *words])
    eventually(lambda: list((tmp_path / "out").glob("*/one-2/0/run.json")))
    process.kill()
    process.wait()
    (campaign,) = (tmp_path / "out").iterdir()
    (campaign / "_config/files/step.sh").write_text(SCRIPT)
    recorder = Recorder()
    summary = resume(campaign, recorder, jobs=1)
    assert verdicts(summary) == NEEDED
    assert recorder.decided == DECIDED
    assert (summary.total, summary.missing) == (12, 0)


def test_more_runs_at_most_continue_what_is_undecided(tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", SCRIPT, RULE)
    summary = run(path, tmp_path / "out", jobs=1, runs=2)
    assert {n: one.decision.state for n, one in enumerate(summary.decided)} == {
        0: "undecided",
        1: "broken",
        2: "undecided",
    }
    recorder = Recorder()
    assert verdicts(resume(summary.campaign, recorder, jobs=1, runs=4)) == NEEDED
    assert recorder.decided == DECIDED
    said = vast("results", "summary", summary.campaign).stdout
    assert SUMMED_UP in said


def test_more_runs_of_one_configuration_leave_the_others_undecided(tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", SCRIPT, RULE)
    campaign = run(path, tmp_path / "out", jobs=1, runs=2).campaign
    recorder = Recorder()
    resume(campaign, recorder, jobs=1, select="one-3", runs=4)
    assert recorder.decided == {"one-3": "inconclusive at 4"}
    said = vast("results", "summary", campaign).stdout
    assert "1 failing after 2, 2 inconclusive at 2-4; 8 of 8 runs needed" in said


def test_more_runs_than_the_first_few_bring_back_the_least_ones(tmp_path: Path) -> None:
    rule = RULE.replace("min: 2", "min: 4").replace("max: 4", "max: 6")
    path = make_campaign(tmp_path / "in", SCRIPT, rule)
    summary = run(path, tmp_path / "out", jobs=1, runs=2, select="one-2")
    recorder = Recorder()
    resume(summary.campaign, recorder, jobs=1, runs=6)
    assert recorder.decided["one-2"] == "failing after 4"
    said = vast("results", "summary", summary.campaign).stdout
    assert "1 failing after 4" in said


def test_each_command_of_the_page_says_what_it_decides(tmp_path: Path) -> None:
    folder = make_campaign(tmp_path / "in", SCRIPT, RULE).parent
    listed, run_all, run_few = page_commands()
    said = vast(*listed, folder=folder).stdout
    assert "3 configurations, 2 to 4 runs each: at most 12 in total" in said
    done = vast(*run_all, *HERE, folder=folder)
    assert done.returncode == 1, done.stderr
    for name, decision in DECIDED.items():
        assert f"{name}: {decision} runs" in done.stdout
    assert f"{SUMMED_UP}." in done.stdout
    assert "12 runs: 5 passed, 4 failed, 3 not needed." in done.stdout
    assert "Continue" not in done.stdout
    assert run_few[-2:] == ["--runs", "20"]
    few = vast(*run_few[:-1], "1", *HERE, folder=folder).stdout
    assert "3 inconclusive at 1; 3 of 3 runs needed." in few

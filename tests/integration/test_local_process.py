"""Campaigns as plain processes: contract, layout, verdicts, and what goes wrong."""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from datetime import datetime, timedelta
from pathlib import Path

import pytest
import yaml
from support.campaigns.local import (
    EXAMPLES,
    ROOT,
    Recorder,
    make_campaign,
    other_environment,
    resume,
    run,
    verdicts,
)
from support.patience import eventually
from support.processes import marked

from robovast.base.errors import CannotRunError, InputError, StorageError
from robovast.base.statistics import anytime, wilson
from robovast.base.yaml_files import read_mapping
from robovast.campaign.merge import merge_campaigns
from robovast.common.execution import campaign_folder_name, is_campaign_dir
from robovast.evaluation.campaign_index import CampaignIndex
from robovast.evaluation.rates import interval_for
from robovast.execution.local.process_environment import process_environment
from robovast.model.seeds import run_seed

PASS = 'echo "$1,$2" > "$3/out.csv"\n'
FAIL_SECOND = 'echo "$1" > "$3/out.csv"; [ "$1" != 2 ]\n'


def test_growth_sim_runs_and_leaves_the_documented_layout(tmp_path: Path) -> None:
    summary = run(EXAMPLES / "growth_sim" / "growth_sim.vast", tmp_path, select="fixed")
    campaign = summary.campaign
    assert campaign.name.startswith("growth-sim-20")
    assert {path.name for path in campaign.iterdir()} == {
        "_config", "_execution", "_jobs", "_transient", "fixed",
    }  # fmt: skip
    run_folder = campaign / "fixed" / "1"
    names = {path.name for path in run_folder.iterdir()}
    assert names == {"test.xml", "run.json", "job", "population.csv"}
    job = {path.name for path in (run_folder / "job").iterdir()}
    assert job >= {"sysinfo.yaml", "logs", "resource_usage_main.csv"}
    assert "Scenario 'growth' succeeded" in (run_folder / "job/logs/system.log").read_text()
    record = json.loads((run_folder / "run.json").read_text())
    assert record["parameters"] == {"growth_rate": 0.07, "initial_population": 123}
    assert (record["verdict"], record["attempt"], record["run"]) == ("passed", 1, 1)
    execution = yaml.safe_load((campaign / "_execution/execution.yaml").read_text())
    assert (execution["runs"], execution["execution_type"]) == (2, "local")


def test_packed_runs_secondary_container_and_commands(tmp_path: Path) -> None:
    path = EXAMPLES / "sensor_service" / "sensor_service.vast"
    summary = run(path, tmp_path)
    assert set(verdicts(summary).values()) == {"passed"}
    assert len(summary.records) == 12
    jobs = sorted(path.name for path in (summary.campaign / "_jobs").iterdir())
    assert jobs == ["job-0", "job-1", "job-2"]
    first = summary.campaign / "gain-1-1" / "0"
    assert (first / "summary.csv").read_text().startswith("samples,mean")
    assert os.readlink(first / "job") == "../../_jobs/job-0"
    assert (first / "job" / "logs" / "system_sensor.log").is_file()
    assert (first / "job" / "resource_usage_sensor.csv").is_file()


SEED = 'echo "$ROBOVAST_SEED" > "$3/out.csv"\n'


def seeds_seen(campaign: Path) -> dict[str, int]:
    """What each run read from its environment, which its record says, too."""
    seen = {}
    for run_folder in sorted(campaign.glob("one-*/[0-9]")):
        record = json.loads((run_folder / "run.json").read_text())
        assert f"{record['seed']}\n" == (run_folder / "out.csv").read_text()
        seen[f"{record['variant']}/{record['run']}"] = record["seed"]
    return seen


@pytest.mark.parametrize("size", [1, 4, "auto"])
def test_each_run_has_a_seed_which_appended_runs_do_not_change(
    tmp_path: Path, size: int | str
) -> None:
    extra = f"  seed: 7\n  runs_per_job: {size}\n"
    summary = run(make_campaign(tmp_path / "in", SEED, extra), tmp_path / "out", runs=1)
    resume(summary.campaign, runs=2)
    runs = [(f"one-{n}", number) for n in (1, 2, 3) for number in (0, 1)]
    assert seeds_seen(summary.campaign) == {f"{v}/{n}": run_seed(7, v, n) for v, n in runs}


def test_short_runs_share_ever_more_of_a_start_where_packs_are_measured(tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", "true\n", "  runs_per_job: auto\n")
    summary = run(path, tmp_path / "out", runs=10, jobs=2)
    assert len(summary.records) == 30
    jobs = {path.name for path in summary.campaign.glob("_jobs/job-*")}
    assert len(jobs) < 20
    assert summary.campaign.joinpath("_jobs/job-1").is_dir()


def test_a_seed_that_is_drawn_is_kept_when_the_campaign_goes_on(tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", SEED)
    summary = run(path, tmp_path / "out", select="one-1")
    resume(summary.campaign, runs=2)
    drawn = yaml.safe_load((summary.campaign / "_execution/execution.yaml").read_text())["seed"]
    assert seeds_seen(summary.campaign) == {
        f"one-1/{n}": run_seed(drawn, "one-1", n) for n in (0, 1)
    }
    other = run(path, tmp_path / "out", select="one-1")
    assert seeds_seen(other.campaign)["one-1/0"] != run_seed(drawn, "one-1", 0)


def test_a_campaign_of_an_older_version_goes_on_without_seeds(tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", 'echo "${ROBOVAST_SEED-none}" > "$3/out.csv"\n')
    summary = run(path, tmp_path / "out", select="one-1")
    execution = summary.campaign / "_execution/execution.yaml"
    lines = execution.read_text().splitlines(keepends=True)
    execution.write_text("".join(line for line in lines if not line.startswith("seed:")))
    recorder = Recorder()
    resume(summary.campaign, recorder, runs=2)
    assert recorder.started == ["one-1/1"]
    assert (summary.campaign / "one-1/1/out.csv").read_text() == "none\n"
    assert "seed" not in json.loads((summary.campaign / "one-1/1/run.json").read_text())
    execution.write_text(execution.read_text() + "seed: many\n")
    with pytest.raises(InputError, match=r"execution.yaml: `seed` must be a whole number"):
        resume(summary.campaign)


def test_the_sensor_in_a_container_of_its_own_measures_the_same_with_the_same_seed(
    tmp_path: Path,
) -> None:
    path = EXAMPLES / "sensor_service" / "sensor_service.vast"
    copy = shutil.copytree(path.parent, tmp_path / "in") / path.name
    copy.write_text(copy.read_text().replace("  runs: 2\n", "  runs: 2\n  seed: 3\n"))
    campaigns = [run(copy, tmp_path / "out", select="gain-1-1").campaign for _ in range(2)]
    once, again = ((c / "gain-1-1/0/samples.csv").read_text() for c in campaigns)
    assert once == again != (campaigns[0] / "gain-1-1/1/samples.csv").read_text()


def test_a_failed_test_is_a_result_and_the_others_go_on(tmp_path: Path) -> None:
    summary = run(make_campaign(tmp_path / "in", FAIL_SECOND), tmp_path / "out")
    assert verdicts(summary) == {"one-1/0": "passed", "one-2/0": "failed", "one-3/0": "passed"}


def test_abort_on_failure_starts_nothing_more(tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", "exit 1\n")
    summary = run(path, tmp_path / "out", abort_on_failure=True, jobs=1)
    assert verdicts(summary) == {"one-1/0": "failed"}


def test_parameter_overrides_reach_the_scenario(tmp_path: Path) -> None:
    extra = "  local: {parameter_overrides: [{text: changed}]}\n"
    summary = run(make_campaign(tmp_path / "in", PASS, extra), tmp_path / "out", select="one-1")
    assert (summary.campaign / "one-1/0/out.csv").read_text() == "1,changed\n"
    config = yaml.safe_load((summary.campaign / "one-1/_config/scenario.config").read_text())
    assert config == {"test": {"x": 1, "text": "changed"}}


def test_a_scenario_that_never_ends_meets_its_timeout(tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", "sleep 600\n", "  timeout: 2\n")
    begin = time.monotonic()
    summary = run(path, tmp_path / "out", select="one-1")
    assert time.monotonic() - begin < 300
    assert summary.records[0].verdict == "errored"
    assert "execution.timeout" in summary.records[0].reason


def test_a_timeout_in_a_pack_costs_one_run(tmp_path: Path) -> None:
    script = PASS + '[ "$1" != 2 ] || sleep 600\n'
    path = make_campaign(tmp_path / "in", script, "  timeout: 30\n  runs_per_job: 3\n")
    summary = run(path, tmp_path / "out")
    assert verdicts(summary) == {"one-1/0": "passed", "one-2/0": "errored", "one-3/0": "passed"}


def test_a_pack_whose_program_cannot_be_driven_has_its_verdicts_at_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "other"
    (other / "bin").mkdir(parents=True)
    usual = process_environment(lambda _: None)
    shutil.copytree(usual / "etc", other / "etc")
    program = other / "bin" / "scenario_execution"
    program.write_text(f'#!/bin/sh\nexec {usual}/bin/scenario_execution "$@"\n')
    program.chmod(0o755)
    monkeypatch.setenv("ROBOVAST_PROCESS_ENV", str(other))
    script = 'echo . >> "$3/out.csv"; [ "$1" != 2 ]\n'
    summary = run(make_campaign(tmp_path / "in", script, "  runs_per_job: 3\n"), tmp_path / "out")
    assert verdicts(summary) == {"one-1/0": "passed", "one-2/0": "failed", "one-3/0": "passed"}
    assert [(summary.campaign / run / "out.csv").read_text() for run in verdicts(summary)] == [
        ".\n"
    ] * 3, "each was executed once"


def test_a_scenario_that_kills_its_parent_is_errored_and_the_others_run(tmp_path: Path) -> None:
    script = PASS + 'if [ "$1" = 2 ]; then kill -9 $PPID; fi\n'
    path = make_campaign(tmp_path / "in", script, "  runs_per_job: 3\n")
    summary = run(path, tmp_path / "out")
    assert verdicts(summary) == {"one-1/0": "passed", "one-2/0": "errored", "one-3/0": "passed"}
    assert "SIGKILL" in summary.records[1].reason
    assert (summary.campaign / "one-2/0/out.csv").is_file(), "partial output is kept"


def test_nothing_that_a_scenario_leaves_behind_survives_it(tmp_path: Path) -> None:
    word = f"4{time.time_ns()}"  # its own number says nothing here: it has a namespace
    run(
        make_campaign(tmp_path / "in", f"setsid sleep {word} &\n"), tmp_path / "out", select="one-1"
    )
    assert marked(word) == []


def test_a_failing_pre_command_says_so(tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", PASS, "  pre_command: /config/files/pre.sh\n")
    (path.parent / "files" / "pre.sh").write_text("echo no licence found\nfalse\n")
    summary = run(path, tmp_path / "out", select="one-1")
    assert summary.records[0].verdict == "errored"
    reason = summary.records[0].reason
    assert "the pre command pre.sh failed with code 1; its log ends: no licence found" in reason


def test_a_scenario_that_was_written_for_a_container_finds_its_files(tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", PASS)
    scenario = path.with_name("scenario.osc")
    text = scenario.read_text().replace(
        'here.get_scenario_file_directory() + "/files', '"/config/files'
    )
    assert '"bash " + "/config/files' in text
    scenario.write_text(text)
    summary = run(path, tmp_path / "out", select="one-1")
    assert verdicts(summary) == {"one-1/0": "passed"}
    assert (summary.campaign / "_config" / "scenario.osc").read_text() == text


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_request_to_stop_keeps_finished_runs_and_marks_interrupted_ones(
    tmp_path: Path, number: signal.Signals
) -> None:
    path = make_campaign(tmp_path / "in", PASS + '[ "$1" != 2 ] || sleep 600\n')

    def interrupt(_: object) -> None:
        os.kill(os.getpid(), number)

    summary = run(path, tmp_path / "out", Recorder(on_finished=interrupt), jobs=1)
    assert summary.interrupted
    assert verdicts(summary)["one-1/0"] == "passed"
    assert set(verdicts(summary).values()) <= {"passed", "interrupted"}

    first = (summary.campaign / "one-1/0/run.json").stat().st_mtime_ns
    (path.parent / "files/step.sh").write_text("exit 1\n")  # what runs is the campaign's copy
    (summary.campaign / "_config/files/step.sh").write_text(PASS)
    recorder = Recorder()
    resumed = resume(summary.campaign, recorder)
    assert set(verdicts(resumed).values()) == {"passed"}
    assert len(resumed.records) == 3
    assert "one-1/0" not in recorder.started
    assert (summary.campaign / "one-1/0/run.json").stat().st_mtime_ns == first


def test_a_campaign_goes_on_in_the_environment_that_it_was_begun_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = process_environment(lambda _: None)
    monkeypatch.setenv("ROBOVAST_PROCESS_ENV", str(other_environment(tmp_path / "cache")))
    campaign = run(make_campaign(tmp_path, PASS), tmp_path / "out", select="one-1").campaign
    monkeypatch.delenv("ROBOVAST_PROCESS_ENV")
    with pytest.raises(CannotRunError, match="in the environment other, which is missing"):
        resume(campaign, runs=2, runtime="auto")

    recorder = Recorder()
    resume(campaign, recorder, runs=2)
    changed = f"Continuing with process:{usual.name}. Earlier runs used process:other."
    assert recorder.messages == [changed]

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    recorder = Recorder()
    resume(campaign, recorder, runs=3, runtime="auto")
    assert recorder.messages == []
    record = json.loads((campaign / "one-1/2/run.json").read_text())
    assert (record["runtime"], record["image"]) == ("process", "process:other")


def test_kill_9_loses_nothing_and_resume_finishes_the_campaign(tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", PASS + '[ "$1" = 1 ] || sleep 600\n')
    program = (
        "import sys; sys.path.insert(0, sys.argv[1]); from pathlib import Path;"
        "from support.campaigns.local import run; run(Path(sys.argv[2]), Path(sys.argv[3]), runs=3)"
    )
    arguments = [sys.executable, "-c", program, str(ROOT / "tests"), str(path), str(tmp_path / "o")]
    process = subprocess.Popen(arguments)
    eventually(lambda: any((tmp_path / "o").glob("*/one-*/*/run.json")))
    process.kill()
    process.wait()
    (campaign,) = (tmp_path / "o").iterdir()
    stored = {path: path.stat().st_mtime_ns for path in campaign.glob("one-*/*/run.json")}
    assert 0 < len(stored) <= 3
    (campaign / "_config/files/step.sh").write_text(PASS)
    resumed = resume(campaign)
    assert set(verdicts(resumed).values()) == {"passed"}
    assert len(resumed.records) == 9
    assert all(path.stat().st_mtime_ns == when for path, when in stored.items())


NOT_UNDERSTOOD = {
    "a record of a newer version": lambda text: text.replace('"schema": 1', '"schema": 2'),
    "a record that a power cut emptied": lambda text: "",
    "half a record": lambda text: text[:100],
    "a record without its keys": lambda text: '{"verdict": "passed"}',
    "a record with values of other kinds": lambda text: text.replace('"run": 0', '"run": []'),
    "a record that nobody can parse": lambda text: "[" * 100_000,
    "the record of another run": lambda text: text.replace('"one-1"', '"one-2"'),
    "no record": None,
}


@pytest.mark.parametrize("what", NOT_UNDERSTOOD)
def test_resuming_moves_aside_what_it_does_not_understand(tmp_path: Path, what: str) -> None:
    path = make_campaign(tmp_path / "in", 'echo bag > "$3/rosbag.mcap"')
    summary = run(path, tmp_path / "out", select="one-1", runs=2)
    record = summary.campaign / "one-1" / "0" / "run.json"
    (record.parent / "precious").touch()
    spoil = NOT_UNDERSTOOD[what]
    if spoil is None:
        record.unlink()
    else:
        record.write_text(spoil(record.read_text()))
    left = record.read_bytes() if spoil else None

    (summary.campaign / "_config/files/step.sh").write_text("exit 1\n")
    recorder = Recorder()
    resumed = resume(summary.campaign, recorder, select="one-1", runs=2)
    assert verdicts(resumed) == {"one-1/0": "failed", "one-1/1": "passed"}
    aside = summary.campaign / ".aside" / "one-1" / "0"
    assert {"precious", "rosbag.mcap", "test.xml"} <= {item.name for item in aside.iterdir()}
    assert left is None or (aside / "run.json").read_bytes() == left
    (message,) = [text for text in recorder.messages if ".aside" in text]
    assert "`one-1/0`" in message
    assert "\n" not in message

    record.write_text("")
    resume(summary.campaign, select="one-1", runs=2)
    assert {item.name for item in aside.parent.iterdir()} == {"0", "0.1"}


def test_no_run_is_stored_where_a_link_leads(tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", PASS)
    campaign = run(path, tmp_path / "out", runs=1).campaign
    elsewhere = tmp_path / "elsewhere"
    (campaign / "one-1").rename(elsewhere)
    (campaign / "one-1").symlink_to(elsewhere)
    with pytest.raises(StorageError, match="one-1: is a link"):
        resume(campaign, runs=2)
    assert [item.name for item in elsewhere.iterdir() if item.name.isdecimal()] == ["0"]


def test_a_configuration_alone_gets_more_runs_and_a_killed_session_goes_on(tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", f'{PASS}[ "${{3##*/}}" -lt 3 ] || sleep 600\n')
    campaign = run(path, tmp_path / "out", runs=2).campaign
    seeds = seeds_of(campaign / "one-2")
    words = ["exec", "local", "run", "--resume", campaign, "--config", "one-2"]
    words += ["--runs", "5", "--runtime", "process", "--jobs", "1"]
    process = subprocess.Popen([Path(sys.executable).with_name("vast"), *words])
    eventually(lambda: (campaign / "one-2" / "2" / "run.json").exists())
    process.kill()
    process.wait()
    (campaign / "_config/files/step.sh").write_text(PASS)
    index = CampaignIndex(tmp_path / "out", campaign.name)
    index.refresh()
    assert (index.summary().planned, index.summary().state) == (9, "incomplete")

    summary = resume(campaign)
    assert (summary.total, summary.missing) == (9, 0)
    again = seeds_of(campaign / "one-2")
    assert seeds.items() <= again.items()
    assert len(set(again.values())) == 5
    index.refresh()
    assert (index.summary().planned, index.summary().state) == (9, "finished")
    recorder = Recorder()
    resume(campaign, recorder, select="one-2", runs=4)
    assert recorder.started == []
    resume(campaign, recorder, runs=3)
    assert sorted(recorder.started) == ["one-1/2", "one-3/2"]
    recorded = read_mapping(campaign / "_execution/execution.yaml")
    assert (recorded["runs"], recorded["more_runs"]) == (3, {"one-2": 5})


@pytest.mark.parametrize("select", [None, "one-*", "one-1"])
def test_intervals_are_wider_once_runs_were_added(tmp_path: Path, select: str | None) -> None:
    campaign = run(make_campaign(tmp_path / "in", PASS), tmp_path / "out", runs=1).campaign
    resume(campaign)
    resume(campaign, runs=1)
    index = CampaignIndex(tmp_path / "out", campaign.name)
    index.refresh()
    assert interval_for(index.summary()) is wilson
    resume(campaign, select=select, runs=2)
    resume(campaign)
    index.refresh()
    assert index.summary().state == "finished"
    assert interval_for(index.summary()) is anytime


@pytest.mark.parametrize("name", ["files/step.sh", "test.vast", "scenario.osc"])
def test_who_edits_inputs_of_a_campaign_is_told_that_further_runs_differ(
    tmp_path: Path, name: str
) -> None:
    path = make_campaign(tmp_path / "in", PASS)
    campaign = run(path, tmp_path / "out", runs=1).campaign
    (path.parent / "files/step.sh").write_text("exit 1\n")
    unchanged, edited, older = Recorder(), Recorder(), Recorder()
    resume(campaign, unchanged, select="one-3", runs=2)
    assert not [text for text in unchanged.messages if "edited" in text]
    with (campaign / "_config" / name).open("a") as file:
        file.write("# edited\n")
    resume(campaign, edited, select="one-3", runs=3)
    (told,) = [text for text in edited.messages if "edited" in text]
    assert told.startswith(f"{campaign}/_config/{name}: edited after the start of the campaign")
    assert told in (campaign / "_execution/controller.log").read_text()
    (campaign / "_execution/inputs.json").unlink()
    resume(campaign, older, select="one-3", runs=4)
    assert not [text for text in older.messages if "edited" in text]


class Meanwhile(Recorder):
    """Executes more runs of one configuration while another program prepares to do so, too."""

    def __init__(self, campaign: Path) -> None:
        super().__init__()
        self.campaign = campaign

    def message(self, text: str) -> None:
        super().message(text)
        if text.startswith("Continuing with"):
            resume(self.campaign, select="one-1", runs=3)


def test_what_another_program_plans_meanwhile_stays_planned(tmp_path: Path) -> None:
    campaign = run(make_campaign(tmp_path / "in", PASS), tmp_path / "out", runs=1).campaign
    record = campaign / "_execution/execution.yaml"
    began_with = read_mapping(record) | {"image": "what was here before"}
    record.write_text(yaml.safe_dump(began_with))
    observer = Meanwhile(campaign)
    resume(campaign, observer, select="one-2", runs=2)
    assert observer.started == ["one-2/1"]
    assert read_mapping(record)["more_runs"] == {"one-1": 3, "one-2": 2}


def seeds_of(variant: Path) -> dict[str, int]:
    records = variant.glob("*/run.json")
    return {file.parent.name: json.loads(file.read_text())["seed"] for file in records}


def test_a_record_with_further_keys_is_understood(tmp_path: Path) -> None:
    summary = run(make_campaign(tmp_path / "in", PASS), tmp_path / "out", select="one-1", runs=1)
    record = summary.campaign / "one-1" / "0" / "run.json"
    record.write_text(record.read_text().replace('"schema": 1', '"schema": 1, "weather": "fair"'))
    recorder = Recorder()
    assert len(resume(summary.campaign, recorder, select="one-1", runs=1).records) == 1
    assert recorder.started == []
    merged = merge_campaigns([summary.campaign], tmp_path / "merged").target
    assert '"weather": "fair"' in (merged / "one-1" / "0" / "run.json").read_text()


def test_an_output_folder_that_cannot_be_written_is_refused_before_anything_runs(
    tmp_path: Path,
) -> None:
    (tmp_path / "file").write_text("")
    file = make_campaign(tmp_path / "in", PASS)
    for output in (tmp_path / "file", tmp_path / "file" / "out"):
        with pytest.raises(StorageError, match=r"/file is a file, and results go into a folder"):
            run(file, output)


def test_campaigns_that_start_in_one_second_have_folders_of_their_own(tmp_path: Path) -> None:
    now = datetime.now().astimezone()
    taken = {
        campaign_folder_name("test_campaign", now + timedelta(seconds=seconds))
        for seconds in range(20)
    }
    for name in taken:
        (tmp_path / "out" / name).mkdir(parents=True)
    summary = run(make_campaign(tmp_path / "in", PASS), tmp_path / "out")
    assert len(summary.records) == 3
    assert summary.campaign.name not in taken
    assert is_campaign_dir(summary.campaign)


def test_a_campaign_leaves_a_log_of_what_it_did(tmp_path: Path) -> None:
    summary = run(make_campaign(tmp_path / "in", FAIL_SECOND), tmp_path / "out", jobs=1)
    lines = (summary.campaign / "_execution/controller.log").read_text().splitlines()
    line = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3} INFO robovast\.campaign: (.+)")
    texts = [found[1] for found in map(line.fullmatch, lines) if found]
    assert len(texts) == len(lines)
    assert f"{summary.campaign.name}: 3 runs, 0 done before; process, 1 in parallel" in texts
    assert "one-2/0: started" in texts
    assert any(text.startswith("one-2/0: failed after ") for text in texts)


def test_two_programs_do_not_execute_one_campaign(tmp_path: Path) -> None:
    summary = run(make_campaign(tmp_path / "in", PASS), tmp_path / "out", select="one-1")
    (summary.campaign / ".running").mkdir()
    with (summary.campaign / ".running" / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(StorageError, match="another `vast` is running this campaign"):
            resume(summary.campaign, runs=9)
    assert read_mapping(summary.campaign / "_execution" / "execution.yaml")["runs"] != 9


def test_a_glob_that_matches_no_configuration_names_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"`two\*`.*one-1"):
        run(make_campaign(tmp_path / "in", PASS), tmp_path / "out", select="two*")
    assert not (tmp_path / "out").exists()


def test_resuming_what_is_no_campaign_says_so(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not a campaign's folder"):
        resume(tmp_path)


def test_an_environment_of_the_wrong_version_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "env/bin").mkdir(parents=True)
    (tmp_path / "env/etc").mkdir()
    (tmp_path / "env/bin/scenario_execution").write_text("")
    (tmp_path / "env/etc/robovast_compat_version").write_text("1\n")
    monkeypatch.setenv("ROBOVAST_PROCESS_ENV", str(tmp_path / "env"))
    with pytest.raises(CannotRunError, match=r"version `2`.*version `1`.*Rebuild"):
        run(make_campaign(tmp_path / "in", PASS), tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif(os.getuid() != 0, reason="mounting a small disk needs root")
def test_a_full_disk_stops_the_campaign_and_keeps_what_is_stored(tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", 'head -c 300000 /dev/zero > "$3/big"\n')
    disk = tmp_path / "disk"
    disk.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", disk], check=True)
    try:
        with pytest.raises(StorageError, match="disk is full") as error:
            run(path, disk, runs=5, jobs=1)
        assert "--resume" in str(error.value)
        assert list(disk.glob("*/one-1/*/run.json")), "the first run was stored"
    finally:
        subprocess.run(["umount", disk], check=True)

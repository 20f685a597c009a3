"""Campaigns in a real Docker daemon: the same contract, layout and verdicts as plain processes."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.campaigns.hostile import KEY, assert_untouched, links, make_host
from support.campaigns.local import (
    EXAMPLES,
    Recorder,
    make_campaign,
    ros_environment,
    run,
    verdicts,
)
from support.patience import PATIENCE

from robovast.base.errors import CannotRunError
from robovast.campaign.discovery import find_campaigns
from robovast.execution.local import LocalOptions, prepare_run
from robovast.model.document import load_document
from robovast.search.local import SearchSummary, execute_document

PASS = 'echo "$1,$2" > "$3/out.csv"\n'


@pytest.fixture(autouse=True)
def _docker(docker_daemon, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in docker_daemon.env.items():
        monkeypatch.setenv(name, value)


def containers() -> list[str]:
    listing = subprocess.run(["docker", "ps", "-aq"], capture_output=True, text=True, check=True)
    return listing.stdout.split()


def test_growth_sim_equals_the_process_runtime_file_by_file(
    slim_image: str, tmp_path: Path
) -> None:
    path = EXAMPLES / "growth_sim" / "growth_sim.vast"
    here = run(path, tmp_path / "process", select="fixed")
    there = run(path, tmp_path / "docker", select="fixed", runtime="docker", image=slim_image)
    assert _files(here.campaign) == _files(there.campaign)
    assert verdicts(here) == verdicts(there) == {"fixed/0": "passed", "fixed/1": "passed"}
    record = json.loads((there.campaign / "fixed/0/run.json").read_text())
    assert record["image"] == slim_image
    assert record["image_digest"].startswith("sha256:")
    assert containers() == []


@pytest.mark.parametrize(
    ("file", "select", "drivers"),
    [("robot_navigation", "drive-1-1-2-2", 0), ("traffic", "depot-1-1-2", 1)],
)
def test_a_seed_is_the_same_drive_in_processes_and_containers(
    ros_image: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    file: str,
    select: str,
    drivers: int,
) -> None:
    """To the last bit, also where a secondary container drives a second robot."""
    monkeypatch.setenv("ROBOVAST_PROCESS_ENV", ros_environment())
    path = EXAMPLES / "robot_navigation" / f"{file}.vast"
    here = run(path, tmp_path / "process", select=select, runs=1)
    there = run(path, tmp_path / "docker", select=select, runs=1, runtime="docker", image=ros_image)
    mine, theirs = (
        (campaign / select / "0" / "outcome.csv").read_text()
        for campaign in (here.campaign, there.campaign)
    )
    assert mine == theirs
    assert verdicts(here) == verdicts(there) == {f"{select}/0": "passed"}
    for campaign in (here.campaign, there.campaign):
        assert len(list(campaign.glob("_jobs/*/logs/system_traffic.log"))) == drivers


@pytest.mark.parametrize("extra", ["", "  runs_per_job: 3\n", "  run_as_user: 4321\n"])
def test_what_a_container_links_to_is_neither_written_nor_read(
    slim_image: str, tmp_path: Path, extra: str
) -> None:
    """Links of a container lead nowhere, also where its files are another user's."""
    host = make_host(tmp_path / "host")
    path = make_campaign(tmp_path / "in", links(host), extra)
    summary = run(path, tmp_path / "out", runtime="docker", image=slim_image)
    assert set(verdicts(summary).values()) == {"passed"}
    assert_untouched(host)
    folder = summary.campaign / "one-2" / "0"
    assert os.readlink(folder / "map.png") == str(host / "id_ed25519")
    assert (folder / "job" / "out.1" / "authorized_keys").read_text() == "stolen\n"
    assert not [path for path in summary.campaign.rglob("*") if _holds(path, KEY)]
    assert containers() == []


def _holds(path: Path, text: str) -> bool:
    """True for a file with a text; links, pipes and huge files are none."""
    small = path.is_file() and not path.is_symlink() and path.stat().st_size < 1 << 20
    return small and text.encode() in path.read_bytes()


def _files(campaign: Path) -> set[str]:
    return {str(path.relative_to(campaign)) for path in campaign.rglob("*")}


@pytest.mark.parametrize("kind", ["random", "optuna", "qd"])
def test_a_search_of_each_kind(slim_image: str, tmp_path: Path, kind: str) -> None:
    shutil.copytree(EXAMPLES / "drone_landing", tmp_path / "in")
    path = tmp_path / "in" / f"search_{kind}.vast"
    text = re.sub(r"per_batch: \d+", "per_batch: 2", path.read_text())
    path.write_text(re.sub(r"batches: \d+", "batches: 2", text))
    options = LocalOptions(runtime="docker", image=slim_image, runs=1)
    summary = execute_document(load_document(path), tmp_path / "out", options, Recorder())
    assert isinstance(summary, SearchSummary)
    assert summary.stop is not None
    assert (summary.stop.kind, len(summary.records)) == ("batches", 4)
    assert {record.verdict for record in summary.records} <= {"passed", "failed"}
    assert containers() == []


def test_packed_runs_secondary_container_and_commands(slim_image: str, tmp_path: Path) -> None:
    path = EXAMPLES / "sensor_service" / "sensor_service.vast"
    summary = run(path, tmp_path, runtime="docker", image=slim_image, enforce_resources=True)
    assert set(verdicts(summary).values()) == {"passed"}
    first = summary.campaign / "gain-1-1" / "0"
    assert (first / "summary.csv").is_file()
    assert (first / "job" / "logs" / "system_sensor.log").is_file()
    assert containers() == []


def test_a_run_cannot_change_its_inputs_or_another_run(slim_image: str, tmp_path: Path) -> None:
    script = 'touch /config/files/mine && exit 1; touch /out/../../other; ls /out > "$3/seen"\n'
    path = make_campaign(tmp_path / "in", script)
    summary = run(path, tmp_path / "out", runtime="docker", image=slim_image)
    assert set(verdicts(summary).values()) == {"passed"}
    seen = (summary.campaign / "one-2/0/seen").read_text().split()
    assert set(seen) == {"_jobs", "one-2"}


def test_the_containers_of_a_run_have_the_shared_memory_that_the_document_says(
    slim_image: str, tmp_path: Path
) -> None:
    script = 'df --output=size --block-size=M /dev/shm > "$3/seen"\n'
    path = make_campaign(tmp_path / "in", script, "  resources: {shm_size: 96Mi}\n")
    summary = run(path, tmp_path / "out", runtime="docker", image=slim_image)
    assert (summary.campaign / "one-1/0/seen").read_text().split() == ["1M-blocks", "96M"]


def test_a_timeout_ends_the_container(slim_image: str, tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", "sleep 600\n", "  timeout: 2\n")
    begin = time.monotonic()
    summary = run(path, tmp_path / "out", select="one-1", runtime="docker", image=slim_image)
    assert time.monotonic() - begin < 300
    assert summary.records[0].verdict == "errored"
    assert containers() == []


@pytest.mark.parametrize(
    ("fixture", "says"),
    [("wrong_compat_image", "version `1`"), ("no_compat_image", "has no version")],
)
def test_an_incompatible_image_is_refused_before_anything_starts(
    fixture: str, says: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    image = request.getfixturevalue(fixture)
    with pytest.raises(CannotRunError) as error:
        run(make_campaign(tmp_path / "in", PASS), tmp_path / "out", runtime="docker", image=image)
    message = str(error.value)
    assert image in message
    assert "needs image interface version `2`" in message
    assert says in message
    assert "container/build.sh" in message
    assert not (tmp_path / "out").exists()


def test_an_image_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    image = "localhost:5000/robovast:no-such-image"
    with pytest.raises(CannotRunError, match="cannot be pulled"):
        run(make_campaign(tmp_path / "in", PASS), tmp_path / "out", runtime="docker", image=image)


def test_a_daemon_that_does_not_run_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DOCKER_HOST", f"unix://{tmp_path}/none.sock")
    path = make_campaign(tmp_path / "in", PASS)
    with pytest.raises(CannotRunError, match=r"does not answer.*--runtime process"):
        run(path, tmp_path / "out", runtime="docker", image="any")


def test_auto_takes_docker_when_it_answers_and_says_so(slim_image: str, tmp_path: Path) -> None:
    recorder = Recorder()
    path = make_campaign(tmp_path / "in", PASS)
    summary = run(
        path, tmp_path / "out", recorder, select="one-1", runtime="auto", image=slim_image
    )
    assert summary.records[0].runtime == "docker"
    assert any("docker" in message for message in recorder.messages)


def test_auto_falls_back_to_processes_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DOCKER_HOST", f"unix://{tmp_path}/none.sock")
    recorder = Recorder()
    path = make_campaign(tmp_path / "in", PASS)
    summary = run(path, tmp_path / "out", recorder, select="one-1", runtime="auto", image="any")
    assert summary.records[0].runtime == "process"
    assert any("local processes" in message for message in recorder.messages)


def _prepared(tmp_path: Path, image: str | None) -> Path:
    document = load_document(make_campaign(tmp_path / "in", PASS))
    return prepare_run(document, tmp_path / "run", LocalOptions(select="one-1", image=image))


def call(script: Path, *arguments: str, text: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [script, *arguments], capture_output=True, text=True, input=text, check=False
    )


def test_prepared_run_needs_nothing_but_docker(slim_image: str, tmp_path: Path) -> None:
    script = _prepared(tmp_path, slim_image)
    result = call(script, "-t", "-d", "--no-gui")
    assert result.returncode == 0, result.stderr
    (campaign,) = (tmp_path / "run/out").iterdir()
    assert (campaign / "one-1/0/out.csv").read_text() == "1,a\n"
    assert (campaign / "one-1/0/test.xml").is_file()
    log = (campaign / "one-1/0/job/logs/system.log").read_text()
    assert "DEBUG" in log
    assert containers() == []


def test_prepared_run_opens_a_shell_in_the_container(slim_image: str, tmp_path: Path) -> None:
    script = _prepared(tmp_path, None)
    result = call(
        script, "--image", slim_image, "--shell", text="cat /config/scenario.osc; id -u\n"
    )
    assert "scenario test:" in result.stdout
    assert result.returncode == 0


def test_start_only_opens_a_shell_with_the_inputs(slim_image: str, tmp_path: Path) -> None:
    path = make_campaign(tmp_path / "in", PASS)
    options = ["--start-only", "--runtime", "docker", "--image", slim_image, "-c", "one-2"]
    vast = Path(sys.executable).with_name("vast")
    result = call(vast, "-V", str(path), "exec", "local", "run", *options, text="ls /config\n")
    assert "scenario.params.yaml" in result.stdout.split()
    assert result.returncode == 0, result.stderr


def test_prepared_run_uses_the_network_of_the_machine_on_request(
    slim_image: str, tmp_path: Path
) -> None:
    result = call(_prepared(tmp_path, slim_image), "--network-host", "--shell", text="hostname\n")
    assert result.stdout.split()[-1:] == [os.uname().nodename]


def test_prepared_run_puts_results_where_it_is_told(slim_image: str, tmp_path: Path) -> None:
    script = _prepared(tmp_path, slim_image)
    result = call(script, "--results-dir", str(tmp_path / "mine"), "--log-tree", "--debug")
    assert result.returncode == 0, result.stderr
    (campaign,) = find_campaigns(tmp_path / "mine")
    assert re.fullmatch(r"test_campaign-\d{4}-\d{2}-\d{2}-\d{8}", campaign.name)
    assert f"Results: {campaign}" in result.stdout
    target = tmp_path / "the one"
    assert call(script, "--campaign-dir", str(target)).returncode == 0
    assert (target / "one-1/0/test.xml").is_file()
    again = call(script, "--campaign-dir", str(target))
    assert (again.returncode, "is not empty" in again.stderr) == (5, True)


def test_prepared_runs_that_start_together_have_folders_of_their_own(
    slim_image: str, tmp_path: Path
) -> None:
    script = _prepared(tmp_path, slim_image)
    processes = [subprocess.Popen([script], stdout=subprocess.DEVNULL) for _ in range(3)]
    assert [process.wait(PATIENCE) for process in processes] == [0, 0, 0]
    campaigns = find_campaigns(tmp_path / "run/out")
    assert [(path / "one-1/0/test.xml").is_file() for path in campaigns] == [True] * 3


def test_prepared_run_ends_after_a_job_that_fails_on_request(
    slim_image: str, tmp_path: Path
) -> None:
    document = load_document(make_campaign(tmp_path / "in", "exit 1\n"))
    script = prepare_run(document, tmp_path / "run", LocalOptions(image=slim_image))
    assert (
        call(script, "--abort-on-failure", "--results-dir", str(tmp_path / "one")).returncode == 1
    )
    assert call(script, "--results-dir", str(tmp_path / "all")).returncode == 1
    counts = [len(list((tmp_path / name).glob("*/*/*/test.xml"))) for name in ("one", "all")]
    assert counts == [1, 3]


def test_prepared_run_opens_one_shell(slim_image: str, tmp_path: Path) -> None:
    document = load_document(make_campaign(tmp_path / "in", PASS))
    script = prepare_run(document, tmp_path / "run", LocalOptions(image=slim_image))
    for option in ("--shell", "--start-only"):
        assert call(script, option, text="echo one\n").stdout.split().count("one") == 1


def test_prepared_run_checks_the_image_first(wrong_compat_image: str, tmp_path: Path) -> None:
    result = call(_prepared(tmp_path, None), "--image", wrong_compat_image)
    assert result.returncode == 3
    assert "`2` is needed" in result.stderr
    assert "`1`" in result.stderr
    assert not (tmp_path / "run/out").exists()


def test_prepared_run_refuses_an_unknown_option(tmp_path: Path) -> None:
    result = call(_prepared(tmp_path, "any"), "--imge", "x")
    assert result.returncode == 2
    assert "unknown option --imge" in result.stderr


def test_a_replay_takes_the_image_of_the_digest_that_ran_and_says_when_that_is_gone(
    slim_image: str, tmp_path: Path
) -> None:
    """Also a run of a cluster, whose record names the digest of its pod's image."""
    path = make_campaign(tmp_path / "in", 'echo "$ROBOVAST_SEED" > "$3/out.csv"\n')
    summary = run(path, tmp_path / "out", select="one-1", runtime="docker", image=slim_image)
    folder = summary.campaign / "one-1" / "0"

    def replay(*options: str) -> tuple[int, str]:
        command = [Path(sys.executable).with_name("vast"), "replay", folder, *options]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr

    record = json.loads((folder / "run.json").read_text())
    for runtime in ("docker", "kubernetes"):
        changed = {**record, "runtime": runtime, "image": "registry.invalid/runs:1"}
        (folder / "run.json").write_text(json.dumps(changed))
        code, said = replay()
        assert (code, "same verdict (passed), same out.csv." in said) == (0, True), said
    gone = "registry.invalid/runs@sha256:" + "5" * 64
    (folder / "run.json").write_text(json.dumps({**changed, "image_digest": gone}))
    code, said = replay()
    assert code == 3
    assert f"the image {gone} is not on this machine and cannot be pulled" in said
    assert "with the current image of this name: `--image registry.invalid/runs:1`" in said
    assert replay("--image", slim_image)[0] == 0
    assert containers() == []

"""What runs make of their folders leads nowhere: neither here nor in the work volume of a pod."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path

import pytest
from robovast_testbed.s3 import Server
from support.campaigns.hostile import KEY, assert_untouched, links, make_host
from support.campaigns.local import Recorder, make_campaign, run, verdicts
from support.kube.pod_processes import Campaign, Pod

PACK = "  runs_per_job: 3\n  timeout: 300\n"
ALL_PASSED = dict.fromkeys(("one-1/0", "one-2/0", "one-3/0"), "passed")

Make = Callable[..., Campaign]

one_server = pytest.mark.parametrize("s3_server", ["minio"], indirect=True)


@pytest.fixture
def host(tmp_path: Path) -> Iterator[Path]:
    folder = make_host(tmp_path / "host")
    yield folder
    assert_untouched(folder)


@pytest.fixture
def make(tmp_path: Path, s3_server: Server) -> Iterator[Make]:
    made: list[Campaign] = []

    def make(script: str, extra: str = PACK) -> Campaign:
        vast = make_campaign(tmp_path / "source", script, extra)
        made.append(Campaign(tmp_path / "mounts", vast, s3_server, {}))
        return made[-1]

    yield make
    for campaign in made:
        campaign.close()


@pytest.mark.parametrize("extra", ["", PACK])
def test_links_of_a_run_lead_nowhere(host: Path, tmp_path: Path, extra: str) -> None:
    summary = run(make_campaign(tmp_path / "in", links(host), extra), tmp_path / "out")
    assert verdicts(summary) == ALL_PASSED
    folder = summary.campaign / "one-1" / "0"
    job = os.readlink(folder / "job").removeprefix("../../_jobs/")
    assert job.startswith("job-")
    assert os.readlink(folder / "job.1") == str(host), "what the run made has another name"
    assert (folder / "map.png").readlink() == host / "id_ed25519", "links are kept as links"
    assert json.loads((folder / "run.json").read_text())["verdict"] == "passed"
    assert (folder / "run.json.1" / "file").read_text() == "own\n"
    rest = summary.campaign / "_jobs" / job / "out.1"
    assert (rest / "authorized_keys").read_text() == "stolen\n"
    assert (rest / "deep" / "er" / "file").read_text() == "stolen\n"
    assert (rest / "deep" / "link").is_symlink()


JUDGED = [
    ("rm {0}/test.xml; mkfifo {0}/test.xml", "is not a regular file"),
    ("rm {0}/test.xml; truncate -s 1T {0}/test.xml", "is larger than"),
    ("cp {0}/test.xml {0}/o; rm {0}/test.xml; ln -s o {0}/test.xml", "is a link"),
    ("echo '<html/>' > {0}/test.xml", "not a JUnit report"),
]


@pytest.fixture(params=JUDGED, ids=lambda case: case[1])
def spoiler(request: pytest.FixtureRequest) -> tuple[str, str]:
    """A step whose run spoils its verdict after it was written; what the reason says then."""
    command, reason = request.param
    watched = f"until [ -e $3/test.xml ]; do sleep 0.02; done; {command.format('$3')}"
    step = f"( set -m; ( {watched}; touch $3/spoilt ) >/dev/null 2>&1 & )\n"
    return step, reason


def test_a_spoilt_verdict_is_an_error_and_hangs_nobody(
    tmp_path: Path, spoiler: tuple[str, str]
) -> None:
    step, reason = spoiler
    document = make_campaign(tmp_path / "in", step, "  post_command: files/wait.sh\n")
    wait = document.parent / "files" / "wait.sh"
    spoilt = "for _ in $(seq 3000); do [ ! -e $1/spoilt ] || exit 0; sleep 0.05; done; exit 1\n"
    wait.write_text(f"#!/bin/sh\n{spoilt}")
    wait.chmod(0o755)
    summary = run(document, tmp_path / "out", select="one-1")
    (record,) = summary.records
    assert (str(record.verdict), reason in record.reason) == ("errored", True), record.reason


@pytest.mark.parametrize("name", ["finished_runs", "finished_runs.part"])
def test_a_pipe_in_place_of_the_list_of_finished_runs_hinders_nobody(
    tmp_path: Path, name: str
) -> None:
    step = f'rm -f "$OUTPUT_DIR/{name}"; mkfifo "$OUTPUT_DIR/{name}"\n'
    assert verdicts(run(make_campaign(tmp_path / "in", step, PACK), tmp_path / "out")) == ALL_PASSED


def test_what_a_run_leaves_behind_changes_nothing_that_is_stored(tmp_path: Path) -> None:
    """It would still hold its file and its folder when these are among the results."""
    step = """\
cd "$3"
[ "$1" != 1 ] || setsid bash -c 'trap "" TERM; while :; do
    echo 1 >> trace.csv; [ ! -e run.json ] || rm -f test.xml; sleep 0.01
done' > /dev/null 2>&1 < /dev/null &
until [ "$1" != 1 ] || [ -e trace.csv ]; do sleep 0.05; done
sleep 1
"""
    summary = run(make_campaign(tmp_path / "in", step, PACK), tmp_path / "out")
    assert verdicts(summary) == ALL_PASSED
    folder = summary.campaign / "one-1" / "0"
    (record,) = [record for record in summary.records if record.variant == "one-1"]
    stored = ((name, (folder / name).read_bytes()) for name in ("test.xml", "trace.csv"))
    assert {name: sha256(content).hexdigest() for name, content in stored} == record.outputs


def test_a_folder_that_a_run_makes_for_another_ends_none(tmp_path: Path) -> None:
    step = 'mkdir -p "$3/../../one-2/0" "$3/../../one-3/0"; sleep 1; echo 1 > "$3/late.csv"\n'
    summary = run(make_campaign(tmp_path / "in", step, PACK), tmp_path / "out")
    assert verdicts(summary) == ALL_PASSED
    assert (summary.campaign / "one-1" / "0" / "late.csv").exists()


def test_a_clock_that_jumps_makes_no_run_overdue(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, ahead = time.time, [0.0]
    monkeypatch.setattr(time, "time", lambda: real() + ahead[0])
    document = make_campaign(tmp_path / "in", "sleep 1.5\n", "  timeout: 600\n")

    class Setter(Recorder):
        def run_started(self, run: object) -> None:
            ahead[0] = 3600.0

    summary = run(document, tmp_path / "out", Setter(), select="one-1")
    (record,) = summary.records
    assert (str(record.verdict), record.duration < 600) == ("passed", True), record.reason


IN_POD = """
case $1 in
1)
  ln -s "$host" "$out/one-4"
  ln -s "$host/authorized_keys" "$out/.job/1.over.x"
  touch "$out/.job/1.code.x" "$out/.job/1.code.9999"
  ;;
3) mv "$out/_jobs" "$out/taken" && ln -s "$host" "$out/_jobs" ;; # where the job's own folder was
esac
"""


@one_server
def test_links_in_a_pod_lead_nowhere(make: Make, host: Path) -> None:
    campaign = make(links(host) + IN_POD)
    pod = Pod(campaign)
    pod.run()
    stored = campaign.verdicts()
    assert set(stored) == set(ALL_PASSED), pod.log("agent")
    assert stored["one-1/0"] == "passed"
    keys = campaign.objects()
    assert not [key for key in keys if "map.png" in key or "link" in key or "pipe" in key]
    assert not [key for key in keys if campaign.store.read(campaign.bucket, key) == KEY.encode()]
    assert campaign.read("one-1/0/out.csv") == "1\n"
    work = {path.name for path in pod.work.iterdir()}
    assert "authorized_keys" not in work


@one_server
@pytest.mark.parametrize("inside", [False, True])
def test_links_that_an_image_makes_before_its_run_is_prepared_lead_nowhere(
    make: Make, host: Path, inside: bool
) -> None:
    """Its container lives by then, and may write to its output."""
    campaign = make('echo 1 > "$3/out.csv"\n')
    pod = Pod(campaign)
    for name in (".job", "_jobs", "one-1", "one-2", "one-3"):
        place = pod.out / name
        if inside:
            place.mkdir(parents=True)
            for below in ("lock", "job-0", "0"):
                (place / below).symlink_to(host / "authorized_keys" if name == ".job" else host)
            place.chmod(0)
        else:
            pod.out.mkdir(exist_ok=True)
            place.symlink_to(host)
    pod.out.chmod(0o2777)
    assert pod.run() == 0, pod.log("agent")
    assert campaign.verdicts() == ALL_PASSED
    assert campaign.read("one-1/0/out.csv") == "1\n"


@one_server
def test_logs_of_a_job_that_goes_on_are_its_own(make: Make, tmp_path: Path) -> None:
    other = tmp_path / "other" / "job-0"
    other.mkdir(parents=True)
    (other / "id_ed25519").write_text(KEY)
    step = f"""
out=$ROBOVAST_OUT_DIR
[ "$1" != 1 ] || {{ mv "$out/_jobs" "$out/taken"; ln -s {other.parent} "$out/_jobs"; }}
[ "$1" != 3 ] || sleep 2
"""
    campaign = make(step)
    pod = Pod(campaign)
    pod.run()
    assert campaign.verdicts() == ALL_PASSED, pod.log("agent")
    assert not [key for key in campaign.objects() if "id_ed25519" in key]
    assert (other / "id_ed25519").read_text() == KEY


@one_server
def test_a_job_that_crashed_leaves_no_trap_for_the_next(make: Make, host: Path) -> None:
    """The pod goes on with another job, whose folders were made in advance, as links."""
    step = f"""
out=$ROBOVAST_OUT_DIR
if [ "$1" = 1 ]; then
  mv "$out/_jobs" "$out/taken"; ln -s {host} "$out/_jobs"; ln -s {host} "$out/one-3"
  kill -9 $PPID
fi
"""
    campaign = make(step)
    pod = Pod(campaign)
    assert pod.run() == 11, pod.log("agent")
    assert campaign.verdicts() == {**ALL_PASSED, "one-1/0": "errored"}


@one_server
def test_a_job_that_removes_its_answers_ends(make: Make) -> None:
    step = '[ "$1" != 2 ] || { rm -rf "$ROBOVAST_OUT_DIR/.job"; sleep 5; }\n'
    campaign = make(step, "  runs_per_job: 3\n  timeout: 40\n")  # which ends it
    pod = Pod(campaign)
    pod.run()
    assert campaign.verdicts()["one-1/0"] == "passed", pod.log("agent")

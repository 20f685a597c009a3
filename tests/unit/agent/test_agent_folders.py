"""What the agent and start.sh tell each other by files."""

import fcntl
import math
import os
import shutil
import subprocess
import time
from pathlib import Path
from threading import Thread

import pytest
from support.patience import PATIENCE, eventually

from robovast.agent.container_control import RunContainer
from robovast.agent.job_files import prepare_output, write_environment
from robovast.agent.mounts import Folders
from robovast.agent.pack import Pack, PodStart, read_pack
from robovast.agent.pod_process import follow_job
from robovast.agent.scripts import START
from robovast.agent.silent_runs import Silence
from robovast.campaign.records import EndedRun
from robovast.campaign.verdict import Verdict
from robovast.kubeapi.pod_contract.exit_codes import AgentExit, exit_code_of
from robovast.model.expansion import Variant
from robovast.model.packs import Owner
from robovast.model.plan import Run
from robovast.model.scenario import Scenario, ScenarioParameter

RUNS = tuple(Run(id_, Variant(f"v-{id_}", "v", {"x": id_ / 2}), 0) for id_ in range(3))


def make_pack(**changes: object) -> Pack:
    values = {
        "campaign": "c", "bucket": "b", "owner": None,
        "image": "i",
        "number": 7, "attempt": 1, "runs": RUNS, "done": {}, "first_job": 1,
        "scenario": Scenario("s", (ScenarioParameter("seed", "int", "0", 3),)),
        "timeout": None, "secondaries": (), "environment": {},
    }  # fmt: skip
    return Pack(**{**values, **changes})


@pytest.fixture
def folders(tmp_path: Path) -> Folders:
    return Folders(work=tmp_path)


def prepared(folders: Folders) -> RunContainer:
    """The container of a run whose files are there."""
    container = RunContainer(folders)
    container.begin()
    container.prepare()
    return container


def test_what_an_earlier_job_answered_for_one_that_was_not_ordered_is_no_answer(
    folders: Folders,
) -> None:
    container = prepared(folders)
    for lie in ("2.code.0", "2.started.1.1", "2.oom", "2.over.sim"):
        (folders.answers / lie).touch()
    (folders.answers / "12.code.0").touch()
    container.run(2)
    assert (container.exit_code(2), container.started(2)) == (None, None)
    assert not container.lacked_memory(2)
    assert not container.all_over(2, ["sim"])
    assert container.exit_code(12) == 0


def test_a_pack_is_read_as_it_was_written(tmp_path: Path) -> None:
    odd = Variant("v", "v", {"x": math.inf, "y": [1, {"z": None}], "ü": True})
    owner = Owner(uid="u", namespace="n", name="c", campaign="c-1")
    pack = make_pack(runs=(Run(0, odd, 1),), done={5: Verdict.FAILED}, owner=owner)
    pack.write(tmp_path / "pack.json")
    assert read_pack(tmp_path / "pack.json") == pack


def test_what_is_stored_is_not_run_again() -> None:
    pack = make_pack(done={0: Verdict.PASSED, 2: Verdict.ERRORED}, first_job=2)
    assert pack.first is not None
    assert [run.id for run in pack.first.runs] == [1]
    assert pack.first.name == "job-7-2"
    assert pack.job(2, pack.left).name == "job-7-3"
    assert make_pack(done=dict.fromkeys(range(3), Verdict.PASSED)).first is None


@pytest.mark.parametrize(
    ("verdicts", "code"),
    [
        ([Verdict.PASSED], AgentExit.PASSED),
        ([Verdict.PASSED, Verdict.FAILED], AgentExit.FAILED),
        ([Verdict.FAILED, Verdict.ERRORED, Verdict.PASSED], AgentExit.ERRORED),
    ],
)
def test_the_worst_verdict_decides(verdicts: list[Verdict], code: AgentExit) -> None:
    assert exit_code_of(verdicts) is code


def test_orders_are_rewritten_in_place_and_whole(folders: Folders) -> None:
    container = prepared(folders)
    inode = (folders.orders / "order").stat().st_ino
    container.run(12)
    container.end()
    assert (folders.orders / "order").read_text().split() == ["end"]
    assert (folders.orders / "order").stat().st_ino == inode


def test_a_sign_of_life_that_cannot_be_written_is_not_the_last(
    folders: Folders, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robovast.agent.container_control.HEARTBEAT", 0.05)
    container = prepared(folders)
    heartbeat, aside = folders.orders / "heartbeat", folders.orders / "aside"
    container.beat_for_ever()
    eventually(lambda: heartbeat.read_text().strip())
    heartbeat.rename(aside)
    time.sleep(0.5)
    aside.write_text("".ljust(31) + "\n")
    aside.rename(heartbeat)
    eventually(lambda: heartbeat.read_text().strip())


def begin(folders: Folders, ago: float = 0.0) -> None:
    """Say what a container says when its first job begins."""
    uptime = time.clock_gettime(time.CLOCK_BOOTTIME) - ago
    (folders.answers / f"1.started.{uptime:.2f}").touch()


def test_a_job_has_taken_as_long_as_it_did_when_its_agent_looks_late(folders: Folders) -> None:
    container = prepared(folders)
    begin(folders, ago=100.0)
    stopwatch = container.started(1)
    assert stopwatch is not None
    assert 99 <= stopwatch.seconds < 100 + PATIENCE
    began, ended = stopwatch.period
    assert 99 <= ended - began < 100 + PATIENCE


def test_a_container_is_gone_when_its_lock_is_free_and_it_left_no_code(folders: Folders) -> None:
    container = prepared(folders)
    assert not container.is_gone(1), "it did not start yet"
    with (folders.answers / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        begin(folders)
        assert not container.is_gone(1), "it runs"
    assert container.is_gone(1)
    (folders.answers / "1.code.137").touch()
    assert container.exit_code(1) == 137
    assert not container.is_gone(1), "it ended"


def test_a_container_that_was_killed_before_its_first_order_is_gone(folders: Folders) -> None:
    container = prepared(folders)
    with (folders.answers / "lock").open("w") as lock:
        assert not container.is_gone(1), "it may be just about to take the lock"
        fcntl.flock(lock, fcntl.LOCK_EX)
        (folders.answers / "held").touch()
        assert not container.is_gone(1), "it waits for its first order"
    assert container.is_gone(1)


def test_whatever_a_run_makes_of_the_answers_hangs_nobody(folders: Folders, tmp_path: Path) -> None:
    container = prepared(folders)
    begin(folders)
    (folders.answers / "2.started.now").touch()
    assert container.started(2) is None
    (folders.answers / "lock").unlink()
    os.mkfifo(folders.answers / "lock")
    for name in ("1.code.x", "1.code.", "1.code.1e3", "1.code.99999", "11.code.7"):
        (folders.answers / name).touch()
    assert container.is_gone(1), "nobody can say that it lives"
    assert container.exit_code(1) is None
    folders.answers.rename(folders.out / "taken")
    (tmp_path / "host").mkdir()
    (tmp_path / "host" / "terminated").touch()
    folders.answers.symlink_to(tmp_path / "host")
    assert not container.is_terminated()
    assert container.started(1) is None


class Received:
    """Takes what a job leaves, and remembers its runs."""

    def __init__(self) -> None:
        self.ended: list[EndedRun] = []

    def run_over(self, ended: EndedRun) -> None:
        self.ended.append(ended)

    def job_over(self, job: PodStart, folder: Path, last: EndedRun | None) -> None:
        self.ended += [last] if last else []

    def goes_on(self, job: PodStart) -> None: ...


def test_a_clock_that_is_set_makes_no_run_overdue(
    folders: Folders, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepared(folders)
    job = make_pack(runs=RUNS[:1]).job(1, RUNS[:1])
    prepare_output(folders, job)
    (folders.out / RUNS[0].path / "test.xml").write_text("<testsuite><testcase/></testsuite>")
    real, ahead = time.time, [0.0]
    monkeypatch.setattr(time, "time", lambda: real() + ahead[0])
    received = Received()
    silence = Silence(folders.work / "silent", 0)
    with (folders.answers / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        begin(folders)
        arguments = (folders, job, 600, (), received, lambda: False, silence)
        following = Thread(target=follow_job, args=arguments)
        following.start()
        time.sleep(0.5)
        ahead[0] = 3600.0
        time.sleep(0.5)
        (folders.answers / "1.code.0").touch()
        following.join(PATIENCE)
    (ended,) = received.ended
    assert ended.result.verdict is Verdict.PASSED, ended.result.reason
    assert ended.observed[1] - ended.observed[0] < 600
    assert (folders.orders / "order").read_text().split() == [], "it was not told to stop"


def test_a_container_with_an_uptime_of_its_own_makes_no_run_overdue(folders: Folders) -> None:
    prepared(folders)
    job = make_pack(runs=RUNS[:1]).job(1, RUNS[:1])
    prepare_output(folders, job)
    (folders.out / RUNS[0].path / "test.xml").write_text("<testsuite><testcase/></testsuite>")
    received = Received()
    silence = Silence(folders.work / "silent", 0)
    with (folders.answers / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        (folders.answers / "1.started.0.50").touch()
        arguments = (folders, job, 60, (), received, lambda: False, silence)
        following = Thread(target=follow_job, args=arguments)
        following.start()
        time.sleep(0.5)
        (folders.answers / "1.code.0").touch()
        following.join(PATIENCE)
    (ended,) = received.ended
    assert ended.result.verdict is Verdict.PASSED, ended.result.reason


def test_a_clock_that_is_set_makes_no_agent_silent(folders: Folders, tmp_path: Path) -> None:
    """Bash's own SECONDS follows the clock of the machine; here it runs away."""
    container = prepared(folders)
    container.run(1)
    job = folders.out / "_jobs" / "job-0"
    write_environment(folders, {"ROBOVAST_OUT_DIR": str(folders.out), "OUTPUT_DIR": str(job)})
    (folders.config / "entrypoint.sh").write_text("sleep 2.5\n")
    shutil.copy(START, folders.orders)
    (tmp_path / "clock").write_text("set -T; trap 'SECONDS=$((SECONDS + 600))' DEBUG\n")
    process = subprocess.Popen(
        ["bash", folders.orders / START.name],
        env={**os.environ, "BASH_ENV": str(tmp_path / "clock")},
        start_new_session=True,
    )
    try:
        eventually(lambda: container.exit_code(1) is not None)
        assert container.exit_code(1) == 0
        container.end()
        assert process.wait(PATIENCE) == 0
    finally:
        process.kill()
        process.wait()

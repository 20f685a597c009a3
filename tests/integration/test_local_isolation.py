"""Runs as plain processes see `/config` and `/out`, and harm neither the machine nor each other."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from threading import Timer

import pytest
from robovast_testbed import debian
from robovast_testbed.pytest_plugin import skipped_when_unavailable
from support.campaigns.local import ROOT, Recorder, make_campaign, run, verdicts
from support.patience import eventually
from support.processes import marked

from robovast.execution.local import pack_execution, sandbox

PACK = "  runs_per_job: 3\n"
RUN = (
    "import sys; sys.path.insert(0, sys.argv[1]); from pathlib import Path;"
    "from support.campaigns.local import Recorder, run; seen = Recorder();"
    "run(Path(sys.argv[2]), Path(sys.argv[3]), seen, select='one-1'); print(*seen.messages)"
)
"""A program that executes a campaign."""


@pytest.fixture(autouse=True, params=sandbox.LAUNCHERS)
def launcher(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Each program that can isolate runs."""
    name = str(request.param)
    if not shutil.which(name):
        with skipped_when_unavailable():
            debian.require(name)
    monkeypatch.setattr(sandbox, "LAUNCHERS", {name: sandbox.LAUNCHERS[name]})
    return name


CONTAINER_SCRIPT = """
set -e
cd /out
[ "$ROBOVAST_CONFIG_DIR,$ROBOVAST_OUT_DIR" = /config,/out ]
grep -q step.sh /config/scenario.osc
grep -q 'x: ' /config/scenario.params.yaml
echo "$1" > "/out/one-$1/0/out.csv"
[ "$3" = "/out/one-$1/0" ]
"""


@pytest.mark.parametrize("extra", ["", PACK])
def test_scripts_that_name_the_folders_of_a_container_work(tmp_path: Path, extra: str) -> None:
    seen = Recorder()
    campaign = make_campaign(tmp_path / "in", CONTAINER_SCRIPT, extra)
    summary = run(campaign, tmp_path / "out", seen)
    assert set(verdicts(summary).values()) == {"passed"}
    assert (summary.campaign / "one-2" / "0" / "out.csv").read_text() == "2\n"
    assert not [text for text in seen.messages if "not isolated" in text]
    assert not (summary.campaign / ".running").exists()


HARM = """
refused() {{ if "$@"; then echo "$*" >> /out/harm; fi; }} 2>/dev/null
refused touch {host}/new
refused rm {host}/file
refused truncate -s 0 {host}/file
refused touch /config/new /new /usr/new /root/new
refused sh -c 'echo x >> /config/scenario.osc'
refused kill -9 {pid}
refused sh -c 'same=$(cat /proc/sys/kernel/printk); echo $same > /proc/sys/kernel/printk'
refused test -w /proc/sysrq-trigger
refused mount -o remount,rw /
refused mount -o remount,rw,bind /config
refused umount /config
refused unshare -Urm mount -o remount,rw,bind /usr
refused unshare -Urm umount /config
refused mknod /out/disk b 8 0
refused python3 -c 'import socket; socket.socket(socket.AF_UNIX).connect("{socket}")'
refused chroot /proc/1/root true
refused nsenter -t 1 -m true
refused test -e {hidden}
echo tmp > /tmp/{word} && mkdir ~/.cache && echo "$TMPDIR $HOME" > /out/places
echo shm > /dev/shm/{word}
"""


def test_a_run_writes_to_its_output_and_to_private_folders_only(tmp_path: Path) -> None:
    host = ROOT / ".pytest_cache" / "isolation"  # out of /tmp, which a run does not see at all
    host.mkdir(parents=True, exist_ok=True)
    (host / "file").write_text("mine")
    sockets = (Path(folder, name) for folder, _, names in os.walk("/run") for name in names)
    socket = next((path for path in sockets if path.suffix == ".sock"), Path("/run/docker.sock"))
    word = f"robovast-{time.time_ns()}"
    script = HARM.format(host=host, pid=os.getpid(), socket=socket, hidden=tmp_path, word=word)
    summary = run(make_campaign(tmp_path / "in", script), tmp_path / "out", select="one-1")
    assert verdicts(summary) == {"one-1/0": "passed"}
    rest = summary.campaign / "_jobs" / "job-0" / "out"
    assert not (rest / "harm").exists(), (rest / "harm").read_text()
    assert (rest / "places").read_text() == "/tmp /tmp\n"
    assert [path.name for path in host.iterdir()] == ["file"]
    assert (host / "file").read_text() == "mine"
    assert not Path("/tmp", word).exists()
    assert not Path("/dev/shm", word).exists()


MOUNT_LATER = """
import subprocess, sys, time; from pathlib import Path; from robovast.execution.local import sandbox
name, work, place = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
box = sandbox.Sandbox(sandbox.LAUNCHERS[name], [])
wait = "touch /out/began; until [ -e /out/mounted ]; do sleep 0.02; done; touch $0/harm; true"
program = ["sh", "-c", wait, str(place)]
run = subprocess.Popen(box.command(work, {"/config": work, "/out": work}, program))
while run.poll() is None and not (work / "began").exists():
    time.sleep(0.02)
subprocess.run(["mount", "-t", "tmpfs", "later", str(place)], check=True)
(work / "mounted").touch()
print(run.wait(180), *(path.name for path in place.iterdir()))
"""


@pytest.mark.skipif(os.getuid() != 0, reason="only root can mount")
def test_what_is_mounted_later_is_not_a_run_s_to_write(tmp_path: Path, launcher: str) -> None:
    place = ROOT / ".pytest_cache" / "mounted-later"  # out of /tmp, which a run does not see at all
    place.mkdir(parents=True, exist_ok=True)
    machine = ["unshare", "--mount", "--propagation", "shared"]  # as systemd leaves it
    call = [sys.executable, "-c", MOUNT_LATER, launcher, str(tmp_path), str(place)]
    result = subprocess.run([*machine, *call], capture_output=True, text=True, check=True)
    assert result.stdout == "0\n"


def test_a_secondary_container_shares_memory_and_output(tmp_path: Path) -> None:
    pre = """
if [ "$CONTAINER_NAME" = helper ]; then
  echo hello > /dev/shm/greeting; echo own > /tmp/own; tail -f /dev/null &
else
  until [ -e /dev/shm/greeting ]; do sleep 0.05; done
fi
"""
    sampled = "until grep -q tail /out/_jobs/*/resource_usage_helper.csv; do sleep 0.1; done\n"
    step = sampled + 'cp /dev/shm/greeting "$3/out.csv"; [ ! -e /tmp/own ]\n'
    step = f'echo "$ROBOVAST_JOB" > "$3/token"\n{step}'
    extra = "  pre_command: files/pre.sh\n  secondary_containers: [helper: {}]\n  timeout: 300\n"
    campaign = make_campaign(tmp_path / "in", step, extra)
    (campaign.parent / "files" / "pre.sh").write_text(pre)
    summary = run(campaign, tmp_path / "out", select="one-1")
    assert verdicts(summary) == {"one-1/0": "passed"}
    assert (summary.campaign / "one-1" / "0" / "out.csv").read_text() == "hello\n"
    job = summary.campaign / "_jobs" / "job-0"
    assert "tail" not in (job / "resource_usage_main.csv").read_text()
    token = (summary.campaign / "one-1" / "0" / "token").read_text()
    assert token.startswith("robovast-")
    assert not Path("/dev/shm", token.strip("/\n")).exists()


def test_no_process_outlives_a_killed_vast(tmp_path: Path, launcher: str) -> None:
    word = f"4{time.time_ns()}"
    path = make_campaign(tmp_path / "in", f"setsid sleep {word} & sleep {word}\n")
    only = f"from robovast.execution.local import sandbox; sandbox.LAUNCHERS = {{'{launcher}': "
    program = f"{only}sandbox.LAUNCHERS['{launcher}']}};{RUN}"
    call = [sys.executable, "-c", program, str(ROOT / "tests"), str(path), str(tmp_path / "out")]
    vast = subprocess.Popen(call)
    eventually(lambda: len(marked(word)) >= 2)
    vast.kill()
    vast.wait()
    eventually(lambda: not marked(word))


@pytest.mark.parametrize("after", [0.0, 0.02, 0.05, 0.1, 1.0])
def test_a_request_to_stop_is_heard_at_any_moment(
    tmp_path: Path, after: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pack_execution, "GRACE", 600.0)  # what hears nothing is killed then
    path = make_campaign(tmp_path / "in", "sleep 600\n")

    class Impatient(Recorder):
        def run_started(self, run: object) -> None:
            Timer(after, os.kill, (os.getpid(), signal.SIGINT)).start()

    began = time.monotonic()
    summary = run(path, tmp_path / "out", Impatient(), select="one-1")
    assert summary.interrupted
    assert time.monotonic() - began < 300


def test_where_namespaces_are_forbidden_runs_go_on_without_and_are_told(
    tmp_path: Path, launcher: str
) -> None:
    """In a user namespace that may have no others, as in many containers."""
    step = 'echo "$ROBOVAST_OUT_DIR" > "$3/out.csv"\n'
    path = make_campaign(tmp_path / "in", step)
    call = [sys.executable, "-c", RUN, str(ROOT / "tests"), str(path), str(tmp_path / "out")]
    forbid = 'for kind in user mnt; do echo 0 > /proc/sys/user/max_${kind}_namespaces; done; "$@"'
    command = ["unshare", "--user", "--map-root-user", "sh", "-c", forbid, "sh", *call]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert result.stdout.count("not isolated") == 1
    (out,) = (tmp_path / "out").glob("*/one-1/0/out.csv")
    assert Path(out.read_text().strip()).is_relative_to(tmp_path)

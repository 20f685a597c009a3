"""The testbed's Docker daemon: what other tests build on."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from robovast_testbed import bed
from robovast_testbed.docker import Docker
from support.patience import eventually

TESTBED = Path(bed.__file__).parent.parent


def test_daemon_answers_through_the_yielded_environment(docker_daemon: Docker) -> None:
    info = subprocess.run(
        ["docker", "info", "--format", "{{.DockerRootDir}}"],
        env=os.environ | docker_daemon.env,
        capture_output=True,
        text=True,
        check=True,
    )

    assert info.stdout.strip() == str(docker_daemon.folder / "data")


def test_compose_plugin_is_found(docker_daemon: Docker) -> None:
    assert docker_daemon.run("compose", "version", "--short").startswith("2.")


@pytest.mark.usefixtures("docker_daemon")
def test_a_crashed_session_is_removed_by_the_next() -> None:
    script = (
        f"import sys, time; sys.path.insert(0, {str(TESTBED)!r})\n"
        "from robovast_testbed import bed\n"
        "with bed.session('crashed') as own:\n"
        "    own.spawn('sleep', ['sleep', '1000'])\n"
        "    print(own.daemons[0].process.pid, flush=True)\n"
        "    time.sleep(1000)\n"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE) as session:
        assert session.stdout is not None
        daemon = int(session.stdout.readline())
        session.send_signal(signal.SIGKILL)
    assert Path(f"/proc/{daemon}").exists()

    bed.sweep()

    eventually(lambda: "crashed" not in bed.names())  # others may sweep, too
    assert not bed.Bed("crashed").netns.exists()
    eventually(lambda: not Path(f"/proc/{daemon}").exists())

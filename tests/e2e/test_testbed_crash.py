"""A crashed session with a whole cluster leaves nothing behind, and disturbs no other cluster."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from robovast_testbed import bed
from robovast_testbed.kubernetes import Cluster
from support.patience import eventually

TESTBED = Path(bed.__file__).parent.parent
MARK = "271828"
SESSION = f"""
import sys, time
sys.path.insert(0, {str(TESTBED)!r})
from robovast_testbed import bed, controlplane, images, node
with bed.session("crashed-cluster") as own:
    cluster = controlplane.start(own)
    node.start(cluster, [images.archive()])
    cluster.kubectl(
        "run", "sleeper", f"--image={{images.SLIM}}", "--image-pull-policy=Never",
        "--command", "--", "sleep", "{MARK}",
    )
    cluster.kubectl("wait", "pod/sleeper", "--for=condition=Ready", "--timeout=180s")
    print("up", flush=True)
    time.sleep(1000)
"""


def running() -> set[str]:
    """Return the command lines that belong to the crashed cluster or its pod."""
    lines = set()
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = file.read_text().replace("\0", " ").strip()
        except OSError:
            continue
        if "/crashed-cluster/" in line or line == f"sleep {MARK}":
            lines.add(line)
    return lines


@pytest.fixture
def crashed() -> bed.Bed:
    with subprocess.Popen([sys.executable, "-c", SESSION], stdout=subprocess.PIPE) as session:
        assert session.stdout is not None
        assert session.stdout.readline() == b"up\n"
        session.send_signal(signal.SIGKILL)
    return bed.Bed("crashed-cluster")


def test_next_session_removes_a_crashed_cluster(crashed: bed.Bed, cluster: Cluster) -> None:
    assert f"sleep {MARK}" in running()

    bed.sweep()

    eventually(lambda: not running() and not crashed.folder.exists())  # others may sweep, too
    assert not crashed.netns.exists()
    assert str(crashed.folder) not in Path("/proc/mounts").read_text()
    assert not list(Path("/sys/fs/cgroup").glob(f"*{crashed.cgroup}"))
    assert cluster.kubectl("get", "--raw=/readyz") == "ok"

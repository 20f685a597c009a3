"""The script that waits in the containers of a run until the agent has prepared it."""

from __future__ import annotations

import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.patience import eventually

from robovast.agent.__main__ import main
from robovast.agent.container_control import RunContainer
from robovast.agent.mounts import Folders
from robovast.agent.scripts import AWAIT, SHELL, START
from robovast.kubeapi.pod_contract.exit_codes import AgentExit

TELL = 'echo "$0 $*"\n'


@pytest.fixture
def folders(tmp_path: Path) -> Folders:
    folders = Folders(work=tmp_path)
    for folder in (folders.config, folders.out):  # as Kubernetes mounts them
        folder.mkdir()
    return folders


class Waiting:
    """A container that waits."""

    def __init__(self, folders: Folders, *names: str, silence: int = 120, patience: int = 600):
        text = AWAIT.read_text()
        for name, usual, seconds in (("silence", 120, silence), ("patience", 600, patience)):
            assert f"{name}={usual} " in text
            text = text.replace(f"{name}={usual} ", f"{name}={seconds} ")
        command = [*SHELL, "-c", text, str(folders.orders / "start.sh"), *names]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    def end(self) -> str:
        """What it has written when it has ended well."""
        out, _ = self.process.communicate(timeout=60)
        assert self.process.returncode == 0
        return out


@pytest.fixture
def started() -> Iterator[list[Waiting]]:
    waiting: list[Waiting] = []
    yield waiting
    for one in waiting:
        one.process.kill()
        one.process.communicate()


def prepare(folders: Folders) -> None:
    (folders.work / "start.sh").write_text(TELL)
    (folders.work / "start.sh").rename(folders.orders / "start.sh")


def beat(folders: Folders, ago: float = 0.0) -> None:
    """Give a sign of life of the agent."""
    uptime = time.clock_gettime(time.CLOCK_BOOTTIME) - ago
    (folders.orders / "heartbeat").write_text(f"{uptime:.0f}".ljust(31) + "\n")


@pytest.mark.parametrize("names", [(), ("nav",)], ids=["main", "secondary"])
def test_it_becomes_the_script_that_it_waits_for(
    folders: Folders, started: list[Waiting], names: tuple[str, ...]
) -> None:
    one = Waiting(folders, *names)
    started.append(one)
    container = RunContainer(folders)
    container.begin()
    container.run(1)
    time.sleep(0.5)
    assert one.process.poll() is None
    prepare(folders)
    assert one.end().split() == [str(folders.orders / "start.sh"), *names]
    assert not container.is_terminated()


@pytest.mark.parametrize("script", [AWAIT, START], ids=["await", "start"])
def test_a_shell_that_the_image_makes_strict_waits_too(
    folders: Folders, started: list[Waiting], monkeypatch: pytest.MonkeyPatch, script: Path
) -> None:
    (folders.work / "strict").write_text("set -eu\n")
    monkeypatch.setenv("BASH_ENV", str(folders.work / "strict"))
    container = RunContainer(folders)
    container.begin()
    if script is START:
        (folders.orders / "environment.sh").write_text(f"ROBOVAST_OUT_DIR={folders.out}\n")
        container.prepare()
        shutil.copy(START, folders.orders)
    started.append(Waiting(folders))
    time.sleep(1.0)
    assert started[0].process.poll() is None
    container.end()
    assert started[0].end() == ""


@pytest.mark.parametrize("names", [(), ("nav",)], ids=["main", "secondary"])
def test_no_agent_is_waited_for_for_ever(
    folders: Folders, started: list[Waiting], names: tuple[str, ...]
) -> None:
    """As one whose image cannot be pulled; a secondary container is started again."""
    started.append(Waiting(folders, *names, patience=2))
    assert started[0].end() == ""
    assert RunContainer(folders).is_terminated() == (not names)


def test_an_agent_that_comes_too_late_leaves_the_runs_to_another_pod(
    folders: Folders, started: list[Waiting]
) -> None:
    started.append(Waiting(folders, patience=0))
    assert started[0].end() == ""
    message = folders.work / "message"
    arguments = ["agent", f"--work={folders.work}", f"--message={message}"]
    assert main(arguments) == AgentExit.RUNS_LEFT, "no plan was asked for"
    assert (folders.orders / "order").read_text().split() == ["end"]


def test_an_agent_that_died_is_not_waited_for(folders: Folders, started: list[Waiting]) -> None:
    container = RunContainer(folders)
    container.begin()
    beat(folders)
    started.append(Waiting(folders, silence=3, patience=0))
    time.sleep(1)
    assert started[0].process.poll() is None
    assert started[0].end() == ""


def test_an_agent_that_was_held_up_with_its_machine_is_waited_for(
    folders: Folders, started: list[Waiting]
) -> None:
    """When a machine has slept, its uptime is at once that of an agent that was silent."""
    container = RunContainer(folders)
    container.begin()
    beat(folders)
    started.append(Waiting(folders, silence=10))
    process = started[0].process
    time.sleep(2)
    process.send_signal(signal.SIGSTOP)
    time.sleep(12)
    process.send_signal(signal.SIGCONT)
    time.sleep(2)
    assert process.poll() is None
    beat(folders)
    time.sleep(6)
    assert process.poll() is None
    container.end()
    assert started[0].end() == ""


def test_an_agent_that_died_is_noticed_by_a_container_with_an_uptime_of_its_own(
    folders: Folders, started: list[Waiting]
) -> None:
    RunContainer(folders).begin()
    beat(folders, ago=-1_000_000)
    started.append(Waiting(folders, silence=3))
    assert started[0].end() == ""


def test_it_ends_with_what_could_not_be_prepared(folders: Folders, started: list[Waiting]) -> None:
    container = RunContainer(folders)
    container.begin()
    started += [Waiting(folders), Waiting(folders, "nav")]
    time.sleep(0.5)
    assert [one.process.poll() for one in started] == [None, None]
    container.end()
    assert [one.end() for one in started] == ["", ""]


def test_it_ends_when_it_is_told_to(folders: Folders, started: list[Waiting]) -> None:
    started.append(Waiting(folders))
    looks = Path(f"/proc/{started[0].process.pid}/status")
    trapped = 1 << 14  # SIGTERM
    eventually(lambda: int(looks.read_text().partition("SigCgt:")[2].split()[0], 16) & trapped, 30)
    started[0].process.terminate()
    assert started[0].end() == ""
    assert RunContainer(folders).is_terminated()


def test_waiting_takes_no_processes(folders: Folders, started: list[Waiting]) -> None:
    """They would take CPU from the runs beside, for as long as an image is pulled."""
    started.append(Waiting(folders))
    pid = started[0].process.pid
    time.sleep(1)
    children = Path(f"/proc/{pid}/task/{pid}/children")
    assert {children.read_text() for _ in range(2000)} == {""}


def test_kubernetes_leaves_its_text_as_it_is() -> None:
    """It makes one dollar of two, and replaces `$(NAME)` where there is such a variable."""
    assert "$$" not in AWAIT.read_text()

"""Tables are made beside the server."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from support.patience import eventually
from support.processes import marked

from robovast.evaluation.server.preparing import Preparation, Prepared

SLEEP = f"600.{time.time_ns()}"
"""How long what a child has started sleeps, and no other process of this machine [s]."""
CHILD = """\
import os, signal, subprocess, sys, time
from pathlib import Path
try:
    print("one: 1 run, nothing changed", flush=True)
    print("three: is no campaign of it", flush=True)
    if sys.argv[1] == "quick":
        Path("two/data.db").touch()
        print("two: 1 run, 1 processed", flush=True)
        sys.exit()
    if sys.argv[1] == "killed":
        subprocess.Popen(["sleep", sys.argv[2]])
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(600)
except KeyboardInterrupt:
    print("interrupted; finished work is kept", flush=True)
"""


def preparation(folder: Path, how: str, said: list[str]) -> Preparation:
    campaigns = [folder / name for name in ("one", "two")]
    for campaign in campaigns:
        campaign.mkdir(exist_ok=True)
    child = f"import os; os.chdir({str(folder)!r})\n{CHILD}"
    return Preparation([sys.executable, "-c", child, how, SLEEP], campaigns, said.append)


def test_it_counts_campaigns_and_says_whether_any_table_was_made(tmp_path: Path) -> None:
    said: list[str] = []
    made = preparation(tmp_path, "quick", said)
    assert made.state() == Prepared(0, 2, True)
    made.start()
    eventually(lambda: not made.state().running)
    assert made.state() == Prepared(2, 2, False, True)
    assert said[-1] == "two: 1 run, 1 processed"
    again = preparation(tmp_path, "quick", said)
    again.start()
    eventually(lambda: not again.state().running)
    assert not again.state().changed
    again.end()  # there is nothing to end


def test_it_keeps_what_is_finished_when_the_server_ends(tmp_path: Path) -> None:
    said: list[str] = []
    made = preparation(tmp_path, "slow", said)
    made.start()
    eventually(lambda: made.state().done == 1)
    made.end()
    eventually(lambda: not made.state().running)
    assert said[-1] == "interrupted; finished work is kept"
    assert made.state() == Prepared(1, 2, False, False)


def test_it_ends_whichever_thread_reaps_the_process(tmp_path: Path, monkeypatch) -> None:
    """A busy machine may delay the thread that follows the process until the process is gone."""
    waitid = os.waitid

    def late(kind: int, pid: int, options: int) -> object:
        eventually(lambda: made._process is not None and made._process.returncode is not None)
        return waitid(kind, pid, options)

    monkeypatch.setattr(os, "waitid", late)
    made = preparation(tmp_path, "slow", [])
    made.start()
    eventually(lambda: made.state().done == 1)
    made.end()
    eventually(lambda: not made.state().running)


def test_one_that_is_killed_is_no_longer_waited_for(tmp_path: Path) -> None:
    said: list[str] = []
    made = preparation(tmp_path, "killed", said)
    made.start()
    eventually(lambda: not made.state().running)
    assert made.state() == Prepared(1, 2, False, False)
    assert "was stopped by SIGKILL. Complete it with `vast results postprocess`" in said[-1]
    eventually(lambda: not marked(SLEEP))


def test_a_name_may_have_a_colon(tmp_path: Path) -> None:
    campaign = tmp_path / "hall: 2"
    campaign.mkdir()
    child = "print('hall: 2: 1 run, 1 processed')"
    made = Preparation([sys.executable, "-c", child], [campaign], lambda _: None)
    made.start()
    eventually(lambda: not made.state().running)
    assert made.state().done == 1


def test_without_campaigns_there_is_nothing_to_do() -> None:
    nothing = Preparation(["false"], [], lambda _: None)
    nothing.start()
    assert nothing.state() == Prepared(0, 0, False)

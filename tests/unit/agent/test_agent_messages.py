"""Termination messages fit, and say what counts."""

import json
from pathlib import Path

import pytest
from support.faults.small_disk import small_disk

from robovast.agent.__main__ import main
from robovast.agent.finish import summary
from robovast.campaign.verdict import Verdict
from robovast.kubeapi.pod_contract.exit_codes import AgentExit
from robovast.kubeapi.pod_contract.messages import (
    LIMIT,
    Summary,
    TerminationMessage,
    Verdicts,
    write_error,
)


def test_verdicts_are_told_as_ranges() -> None:
    verdicts = {0: Verdict.PASSED, 1: Verdict.PASSED, 4: Verdict.FAILED, 2: Verdict.ERRORED}
    said = Verdicts.of(verdicts)
    assert said.text == '{"passed": "0-1", "failed": "4", "errored": "2", "counts": [2, 1, 1]}'
    assert Verdicts.read(said.text) == said


def test_a_message_is_never_longer_than_kubernetes_keeps(tmp_path: Path) -> None:
    path = tmp_path / "message"
    path.touch()
    kinds = (Verdict.PASSED, Verdict.FAILED, Verdict.ERRORED)
    verdicts = {id_: kinds[id_ % 3] for id_ in range(10_000)}
    Verdicts.of(verdicts).write(path)
    write_error(path, "ü" * 10_000, as_json=True)
    assert path.stat().st_size <= LIMIT
    assert json.loads(path.read_text())["truncated"] is True


def test_an_error_does_not_hide_the_verdicts(tmp_path: Path) -> None:
    path = tmp_path / "message"
    path.touch()
    Verdicts.of({3: Verdict.PASSED}).write(path)
    write_error(path, "the disk is full", as_json=True)
    told = json.loads(path.read_text())
    assert (told["passed"], told["error"]) == ("3", "the disk is full")


def test_outside_a_container_no_message_is_left(tmp_path: Path) -> None:
    TerminationMessage().write(tmp_path / "message")
    write_error(tmp_path / "message", "no", as_json=False)
    assert list(tmp_path.iterdir()) == []


def test_a_message_that_has_no_room_does_not_change_how_a_container_ends(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "message"
    path.touch()
    with small_disk(0):
        code = main(["finish", f"--plan={tmp_path}", f"--message={path}"])
    assert code == AgentExit.BAD_PLAN
    assert path.read_text() == "", "Kubernetes reads the log in its place"
    assert "not a valid plan of this version" in capsys.readouterr().err


def entry(id_: int, verdict: Verdict, attempt: int = 1) -> dict[str, object]:
    return {"id": id_, "variant": f"v-{id_}", "run": 0, "verdict": verdict, "attempt": attempt}


def test_a_summary_names_the_first_bad_runs_only() -> None:
    index = [entry(id_, Verdict.ERRORED, attempt=0) for id_ in range(0, 40_000, 2)]
    told = summary(index)
    assert (told.total, told.errored, told.stored) == (20_000, 20_000, 0)
    assert told.truncated is True
    assert len(told.failing) == 10
    assert len(told.text) <= LIMIT
    assert Summary.read(told.text) == told

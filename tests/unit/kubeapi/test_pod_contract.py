"""What is said of exit codes, folders and pods in other places is what the protocol says."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.agent.mounts import Folders
from robovast.campaign.judge import EntrypointExit
from robovast.execution.compat import COMPAT_SCRIPT, INCOMPATIBLE
from robovast.execution.contract import contract_files
from robovast.kubeapi.pod_contract.exit_codes import USELESS, AgentExit
from robovast.kubeapi.pod_contract.messages import (
    Composed,
    Summary,
    TerminationMessage,
    Verdicts,
    error_in,
)
from robovast.kubeapi.pod_contract.mounts import Mount
from robovast.kubeapi.pod_contract.pods import own_container

ROOT = Path(__file__).parents[3]


def test_the_page_of_the_agent_lists_its_exit_codes_and_which_are_useless_to_repeat() -> None:
    page = (ROOT / "docs/contributing/agent.md").read_text()
    rows = re.findall(r"^\| (\d+) \|.*\| ([^|]*)\|$", page, re.M)
    assert {int(code) for code, _ in rows} == set(AgentExit)
    assert {int(c) for c, again in rows if again.startswith("no") and int(c) >= 64} == set(USELESS)


def test_the_scripts_end_with_the_codes_that_runs_are_judged_by() -> None:
    text = "\n".join(path.read_text() for path in contract_files() if path.suffix == ".sh")
    assert {int(code) for code in re.findall(r"\bfail (\d+) ", text)} == set(EntrypointExit)
    assert {int(code) for code in re.findall(r"^#   (\d+)  ", text, re.M)} == set(EntrypointExit)
    assert f"exit {INCOMPATIBLE}\n" in COMPAT_SCRIPT


def test_our_containers_look_where_their_volumes_are_and_write_to_the_pods_own_alone() -> None:
    folders = Folders()
    container = own_container("image", "agent", ["agent"], [m for m in Mount if m != Mount.WORK])
    places = {mount["name"]: Path(mount["mountPath"]) for mount in container["volumeMounts"]}
    assert places == {str(mount): getattr(folders, mount) for mount in Mount}
    writable = [m["name"] for m in container["volumeMounts"] if not m.get("readOnly")]
    assert writable == ["work"]


@pytest.mark.parametrize("kind", [Verdicts, Summary, Composed])
@given(said=st.text() | st.recursive(st.none() | st.integers(), st.lists).map(str))
def test_words_that_are_no_message_are_none(kind: type[TerminationMessage], said: str) -> None:
    assert kind.read(said) is None
    error_in(said)


@pytest.mark.parametrize(
    "said", ["[" * 5000, '{"total": ' + "9" * 4000 + "}", '{"error": "\\ud8"}']
)
def test_so_are_words_that_nobody_can_read(said: Any) -> None:
    assert Summary.read(said) is None
    assert error_in(said) == said

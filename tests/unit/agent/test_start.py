"""What the start of our containers costs: what they need not import."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from robovast.base.docstrings import WITHOUT
from robovast.kubeapi.pod_contract.exit_codes import AgentExit

START = """\
import sys
from importlib import import_module

for command in ("prepare", "agent"):
    import_module(f"robovast.agent.{command}")
from robovast.model.document.execution import Execution

unused = {"IPython", "numpy", "pandas", "scipy"}
print(sorted(unused & set(sys.modules)), bool(Execution.model_fields["timeout"].description))
"""


@pytest.mark.parametrize(("variables", "described"), [({WITHOUT: "true"}, False), ({}, True)])
def test_containers_beside_runs_start_without_what_they_never_use(
    variables: dict[str, str], described: bool
) -> None:
    known = {name: value for name, value in os.environ.items() if name != WITHOUT}
    said = subprocess.run(
        [sys.executable, "-c", START], env={**known, **variables},
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    assert said.stdout == f"[] {described}\n"


BUILT = """\
from collections.abc import Iterator
from importlib import import_module

from pydantic import BaseModel

for command in ("prepare", "agent"):
    import_module(f"robovast.agent.{command}")


def below(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    for child in model.__subclasses__():
        yield child
        yield from below(child)


print(sorted(model.__name__ for model in below(BaseModel) if model.__pydantic_complete__))
"""


def test_no_model_is_built_before_it_is_needed() -> None:
    """Building one takes a hundredth of a start, and a pod needs few."""
    said = subprocess.run(
        [sys.executable, "-c", BUILT], capture_output=True, text=True, timeout=120, check=True
    )
    assert said.stdout == "[]\n"


def imported_by(*arguments: str, code: int) -> set[str]:
    """What a program of ours imports, with the process that prepares runs, if it gets there."""
    command = [sys.executable, "-X", "importtime", "-m", "robovast.agent", "agent", *arguments]
    told = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert told.returncode == code, told.stderr
    return {line.rpartition("|")[2].strip() for line in told.stderr.splitlines()}


def test_the_agent_imports_no_documents() -> None:
    """A document is read by a process of its own, before the runs."""
    imported = imported_by("--help", code=0)
    assert "robovast.agent.mounts" in imported
    assert not {name for name in imported if name.startswith("robovast.model.document")}


def test_a_pod_imports_nothing_for_what_its_campaign_does_not_ask(tmp_path: Path) -> None:
    """Neither for a search, reused runs, archives and plugins, nor to say why a run failed."""
    folders = ("--plan=/nowhere", "--message=/nowhere", f"--work={tmp_path}")
    imported = imported_by(*folders, code=AgentExit.BAD_PLAN)
    assert {"robovast.agent.campaign", "robovast.model.expansion"} <= imported
    assert imported.isdisjoint(
        {
            *("robovast.model.document.search.checks", "robovast.agent.reuse"),
            *("robovast.campaign.reasons", "difflib", "statistics"),
        }
    )

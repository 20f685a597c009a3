"""A scenario that cannot be parsed is told with its place, by the parser of scenario-execution."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import DocumentError
from robovast.execution.local.process_environment import VARIABLE, process_environment
from robovast.execution.local.scenario_syntax import check_syntax

HEADER = "import osc.helpers\nscenario a:\n"
NO_TEXT = "this sign does not fit here, or a text has no end or contains a quotation mark"


@pytest.fixture(autouse=True)
def _environment() -> None:
    process_environment(print)


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("    x: float =\n    do serial:\n        emit end\n", ":3:15: …: the line ends too early"),
        ("    do serial:\n", ":3:15: …: the line ends too early"),
        ("    x: int = 1\n        y: int = 2\n", ":4:1: …: the line is indented too far"),
        ("    do serial(:\n        emit end\n", ":3:15: …: `:` does not fit here"),
        ('    x: string = "abc\n', f":3:17: …: {NO_TEXT}"),
        ("    x: string = \"say 'abc'\"\n", f":3:17: …: {NO_TEXT}"),
    ],
)
def test_a_mistake_is_told_with_its_place(tmp_path: Path, body: str, told: str) -> None:
    scenario = tmp_path / "a.osc"
    scenario.write_text(HEADER + body)
    with pytest.raises(DocumentError) as error:
        check_syntax(scenario)
    assert str(error.value).startswith(
        f"{scenario}{told}".replace("…", "the scenario cannot be parsed")
    )


@pytest.mark.parametrize("name", ["m", "kg", "s", "rad"])
def test_a_unit_is_no_name(tmp_path: Path, name: str) -> None:
    scenario = tmp_path / "a.osc"
    scenario.write_text(f"scenario {name}:\n    do serial:\n        emit end\n")
    with pytest.raises(DocumentError, match=f"`{name}` is a unit and cannot be a name; choose"):
        check_syntax(scenario)


def test_what_only_an_image_has_is_no_mistake(tmp_path: Path) -> None:
    scenario = tmp_path / "a.osc"
    scenario.write_text("import osc.their_own\nscenario a:\n    do serial:\n        drive_far()\n")
    check_syntax(scenario)


def test_a_scenario_is_parsed_once_and_again_when_it_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    environment = tmp_path / "environment"
    (environment / "bin").mkdir(parents=True)
    (environment / "bin" / "scenario_execution").touch()
    python = environment / "bin" / "python"
    parsed = tmp_path / "parsed"
    python.write_text(f"#!/bin/sh\necho once >> {parsed}\necho null\n")
    python.chmod(0o755)
    monkeypatch.setenv(VARIABLE, str(environment))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    scenario = tmp_path / "a.osc"
    for body in ("one", "one", "two", "two", "one"):
        scenario.write_text(f"{HEADER}    # {body}\n")
        check_syntax(scenario)
    assert parsed.read_text().split() == ["once", "once"]


def test_a_scenario_is_parsed_where_nothing_can_be_cached(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    obstacle = tmp_path / "a-file"
    obstacle.touch()
    usual = process_environment(print)
    monkeypatch.setenv(VARIABLE, str(usual))
    monkeypatch.setenv("XDG_CACHE_HOME", str(obstacle))
    scenario = tmp_path / "a.osc"
    scenario.write_text(f"{HEADER}    do serial(:\n")
    with pytest.raises(DocumentError):
        check_syntax(scenario)
    scenario.write_text(f"{HEADER}    do serial:\n        emit end\n")
    check_syntax(scenario)

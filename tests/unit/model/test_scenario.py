"""The reader of scenarios takes no text for syntax, and time proportional to the length."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.base.errors import InputError
from robovast.base.time_limit import time_limit
from robovast.model.scenario import read_scenario, read_scenarios

LONG = 10_000
LINES = {
    "spaces in a default": f"    a: b = x{' ' * LONG}y",
    "spaces behind a type": f"    a: list{' ' * LONG}!",
    "spaces behind a name": f"    a{' ' * LONG}!",
    "words `with`": f"    a: b = x{' with' * LONG}",
    "quotes that are not closed": '    a: b = "' + '\\"' * LONG,
    "texts that are not closed": '    a: b = """' + "\\'\"" * LONG,
    "parts of a scenario's name": "scenario a" + ".b" * LONG,
    "spaces in a structure": f"struct a{' ' * LONG}!",
}


@pytest.mark.parametrize("kind", LINES)
def test_a_long_line_takes_no_long_time(tmp_path: Path, kind: str) -> None:
    file = tmp_path / "a.osc"
    file.write_text(f"scenario drive:\n{LINES[kind]}\n    speed: float = 1.0\n")
    with time_limit(5):
        assert read_scenario(file).name == "drive"


@pytest.mark.parametrize(
    ("line", "default"),
    [
        ("a: length = 1.0m with: keep(it > 0)", "1.0m"),
        ("a: length = 1.0m   # most", "1.0m"),
        ('a: string = "x # y"  with:', '"x # y"'),
        ("a: list of float = [1.0, 2.0]", "[1.0, 2.0]"),
        ("a: float with:", None),
        ("a:float=1", "1"),
    ],
)
def test_defaults_end_before_constraints(tmp_path: Path, line: str, default: str | None) -> None:
    file = tmp_path / "a.osc"
    file.write_text(f"scenario drive:\n    {line}\n")
    found = read_scenario(file).parameter("a")
    assert found is not None
    assert found.default_text == default


@pytest.mark.parametrize("name", ["drive", "lib.drive", "a_1"])
def test_names_of_scenarios(tmp_path: Path, name: str) -> None:
    file = tmp_path / "a.osc"
    file.write_text(f"scenario {name} inherits base:\n    a: int = 1\n")
    assert read_scenario(file).name == name


def test_a_scenario_without_a_colon_is_none(tmp_path: Path) -> None:
    file = tmp_path / "a.osc"
    file.write_text("scenario drive\n")
    with pytest.raises(InputError):
        read_scenario(file)


PIECES = (
    *" with: ,=#(]){\"'é\t\v",
    "\\\\",
    "\\n",
    " with: keep(it > 0)",
    "\nscenario b:\n    d: int",
)
PIECES = (*PIECES, "do", "\n", "\n    d: float = 1.0", "\nstruct b:\n    d: int\n")
BEHIND = ("", ' with: keep(it != "\')")', "  # \"with: '", " with:\n        keep(it != '(')")


@given(
    st.lists(st.sampled_from(PIECES)),
    st.sampled_from(['"', "'", '"""', "'''"]),
    st.sampled_from(BEHIND),
)
def test_what_is_quoted_is_no_syntax(pieces: Sequence[str], quote: str, behind: str) -> None:
    inside = "".join(pieces).replace(quote[0], f"\\{quote[0]}")
    if len(quote) == 1:
        inside = inside.replace("\n", "\\\n")
    literal = f"{quote}{inside}{quote}"
    listed = f"[{literal},  # ]\n{literal}]"
    text = f"scenario a:\n    a: string = {literal}{behind}\n    b, c: list of string = {listed}\n"
    with TemporaryDirectory() as folder:
        file = Path(folder, "a.osc")
        file.write_text(f"{text}    d: int = 1\n")
        (found,) = read_scenarios(file)
    assert not found.structs
    defaults = [(one.name, one.default_text) for one in found.parameters]
    assert defaults == [("a", literal), ("b", listed), ("c", listed), ("d", "1")]
    assert found.parameters[-1].line == 1 + text.count("\n")

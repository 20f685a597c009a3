"""Reads the parameters of an OpenSCENARIO 2 scenario without scenario-execution.

scenario-execution pins versions that conflict with ours, and calling it takes half a second. A
scenario's overwritable parameters are the `name: type = default` lines at the first level of
indentation in its body, as the fields of a `struct` are; this module reads nothing else.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError
from robovast.base.file_errors import read_text

_SCENARIO = re.compile(r"^scenario\s++([A-Za-z_]\w*+(?:\.\w++)*+)[^:]*:")
_STRUCT = re.compile(r"^struct\s++([A-Za-z_]\w*+)(?:\s++inherits\s++([A-Za-z_]\w*+))?\s*+(?::.*)?$")
_PARAMETER = re.compile(
    r"^(?P<names>[A-Za-z_]\w*(?:\s*,\s*[A-Za-z_]\w*)*)\s*:\s*"
    r"(?P<type>(?:list\s+of\s+)?[A-Za-z_][\w.]*)\s*+"
    r"(?:=\s*+(?P<default>\S.*?)(?<!\s)\s*+)?(?:\bwith\s*:.*)?$",
    re.DOTALL,
)
_TOKEN = re.compile(
    r"(?P<quote>\"{3}|'{3})(?:\\.|(?!(?P=quote)).)*+(?P=quote)?|#[^\n\f]*|\\[ \t]*+.|"
    r"\"(?:\\.|[^\"\\\n])*+\"?|'(?:\\.|[^'\\\n])*+'?",
    re.DOTALL,
)
"""A text, a comment, or an escape outside of both, so that no part of a file is read twice."""
_LINE = re.compile(r"[^\n\f]+")

SEED = "seed"
"""The parameter that gets a run's seed when the document does not set it."""
_NUMBERS = frozenset({"int", "uint", "float"})


@dataclass(frozen=True)
class ScenarioParameter:
    """A parameter that a run may override."""

    name: str
    type: str
    """The declared type, such as `float` or `list of pose_3d`."""
    default_text: str | None
    """The default as written in the file; None without a default."""
    line: int


@dataclass(frozen=True)
class Scenario:
    """A scenario's name and its parameters in file order."""

    name: str
    parameters: tuple[ScenarioParameter, ...]
    structs: Mapping[str, tuple[ScenarioParameter, ...]] = field(default_factory=dict)
    """Fields of the structures that its file declares, by name."""
    file: str = ""
    """Name of its file."""

    def parameter(self, name: str) -> ScenarioParameter | None:
        """The parameter of a name; None if there is none."""
        return next((p for p in self.parameters if p.name == name), None)

    @property
    def types(self) -> dict[str, str]:
        """Declared types by name."""
        return {p.name: p.type for p in self.parameters}

    @property
    def takes_seed(self) -> bool:
        """Whether it declares the number `seed`, to which a run's seed is given."""
        return any(p.name == SEED and p.type in _NUMBERS for p in self.parameters)


_Block = tuple[str, tuple[ScenarioParameter, ...]]
"""A statement, such as `scenario drive:`, and the parameters in its body."""


def read_scenario(path: str | Path) -> Scenario:
    """The first scenario of a file.

    Raises:
        InputError: the file is missing or contains no scenario.
    """
    return read_scenarios(path)[0]


def read_scenarios(path: str | Path) -> list[Scenario]:
    """All scenarios of a file, at least one.

    Raises:
        InputError: the file is missing or contains no scenario.
    """
    path = Path(path)
    try:
        text = read_text(path)
    except InputError as error:
        if isinstance(error.__context__, FileNotFoundError):
            raise InputError(f"there is no scenario file {path}") from None
        raise
    blocks = list(_blocks(text))
    structs = _structs(blocks)
    scenarios = [
        Scenario(match[1], parameters, structs, path.name)
        for head, parameters in blocks
        if (match := _SCENARIO.match(head))
    ]
    if not scenarios:
        raise InputError(
            f"{path} declares no scenario: a line `scenario <name>:` is missing",
            hint="add this line",
        )
    return scenarios


def _structs(blocks: list[_Block]) -> dict[str, tuple[ScenarioParameter, ...]]:
    """Fields of each structure, unless it inherits some from elsewhere."""
    fields: dict[str, tuple[ScenarioParameter, ...]] = {}
    for head, own in blocks:
        if (match := _STRUCT.match(head)) and (match[2] is None or match[2] in fields):
            fields[match[1]] = (*fields.get(match[2] or "", ()), *own)
    return fields


def get_scenario_parameters(scenario_file: str | Path) -> dict[str, list[dict[str, Any]]]:
    """Overwritable parameters of a file's scenarios, `{scenario: [{name, type, is_list}]}`.

    For a list, the type is that of its items.
    """
    return {
        scenario.name: [_description(parameter) for parameter in scenario.parameters]
        for scenario in read_scenarios(scenario_file)
    }


def _description(parameter: ScenarioParameter) -> dict[str, Any]:
    words = parameter.type.split()
    return {"name": parameter.name, "type": words[-1], "is_list": len(words) > 1}


def scenario_defaults(scenario_file: str | Path) -> dict[str, Any]:
    """Overwritable parameters of a file's first scenario, with their defaults.

    A default that is an expression is given as text, a missing default as None.
    """
    parameters = read_scenario(scenario_file).parameters
    return {parameter.name: _default(parameter.default_text) for parameter in parameters}


def parameter_types(scenario_file: str | Path) -> dict[str, str]:
    """Declared types of the first scenario's parameters; empty if the file cannot be read."""
    try:
        return read_scenario(scenario_file).types
    except InputError:
        return {}


def is_scenario_parameter(name: str, scenario_file: str | Path) -> bool:
    """Whether the file's scenario has the parameter."""
    return name in scenario_defaults(scenario_file)


def _default(text: str | None) -> Any:
    # Each pod's agent starts with this module, and reads no scenario.
    from robovast.base.yaml_files import parse_yaml

    try:
        return None if text is None else parse_yaml(text)
    except ValueError:
        return text


def _blocks(text: str) -> Iterator[_Block]:
    """Each statement without indentation, with the parameters in its body."""
    plain = _TOKEN.sub(_hidden, text)
    head, indent, line, counted = "", 0, 1, 0
    parameters: list[ScenarioParameter] = []
    for begin, end in _statements(plain):
        line, counted = line + text.count("\n", counted, begin), begin
        code = plain[begin:end].lstrip()
        width = len(plain[begin : end - len(code)].expandtabs(8))
        if width == 0:
            if head:
                yield head, tuple(parameters)
            head, indent, parameters = code, 0, []
        elif head and width == (indent := indent or width):
            parameters += _parameters(code.rstrip(), text[end - len(code) : end], line)
    if head:
        yield head, tuple(parameters)


def _hidden(match: re.Match[str]) -> str:
    """What stands for a text or a comment, with its length, and means nothing itself."""
    return ("'" if match[0][0] in "'\"" else " ") * len(match[0])


def _statements(plain: str) -> Iterator[tuple[int, int]]:
    """Where each statement begins and ends; it continues until its brackets close."""
    begin = depth = 0
    for line in _LINE.finditer(plain):
        if not line[0].strip():
            continue
        begin = begin if depth > 0 else line.start()
        depth += sum(map(line[0].count, "([{")) - sum(map(line[0].count, ")]}"))
        if depth <= 0:
            yield begin, line.end()


def _parameters(plain: str, text: str, line: int) -> Iterator[ScenarioParameter]:
    match = _PARAMETER.match(plain)
    if match and match["names"] != "do":
        default = text[slice(*match.span("default"))] if match["default"] else None
        for name in re.split(r"\s*,\s*", match["names"]):
            yield ScenarioParameter(name, match["type"], default, line)

"""Parses YAML text to plain data and records the line and column of every key and value."""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from robovast.base.errors import DocumentError, Place, Problem
from robovast.base.file_errors import read_text
from robovast.base.yaml_files import YamlLoader, compose_yaml

KeyPath = tuple[Hashable, ...]
"""Path of a value in the document: keys and list indexes from the root."""

MAX_REPEATED = 100_000
"""Most values that aliases may repeat: a few lines of YAML can expand to billions of values."""


def render_path(path: KeyPath) -> str:
    """`("configuration", 2, "name")` as `configuration[2].name`."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


_CAUSES = {
    "mapping values are not allowed": (
        "there is a second `:` in one value. Put a text with `: ` into quotes, start a nested "
        "mapping on a new line, and indent keys like the keys around them"
    ),
    "found undefined alias": "`*name` has no matching anchor `&name` above it",
    "did not find expected key": (
        "this does not continue the mapping that begins in line {0}; is it indented like the "
        "lines around it?"
    ),
    "did not find expected '-' indicator": (
        "this does not continue the list that begins in line {0}; is it indented like the lines "
        "around it?"
    ),
    "did not find expected ',' or ']'": "the `[` of line {0} is not closed: here must be `,` or "
    "`]`",
    "did not find expected ',' or '}}'": "the `{{` of line {0} is not closed: here must be `,` or "
    "`}}`",
    "did not find expected node content": "a value or a closing bracket is missing here",
    "found unexpected end of stream": "the quotes that open in line {0} are not closed",
    "could not find expected ':'": "there is no `:` after the key in line {0}",
    "found unknown escape character": "double quotes do not know this escape: write `\\\\` for a "
    "backslash, or use single quotes, which have no escapes",
    "expected a mapping or list of mappings for merging": "`<<` can only merge mappings",
}
"""Our messages by the beginning of libyaml's; `{0}` is the line where the construct begins."""


def _cause(error: yaml.MarkedYAMLError, text: str) -> str:
    """The cause of a YAML error, and the construct it is in, which may begin far above."""
    mark, began = error.problem_mark, error.context_mark
    if str(error.problem).startswith("found character that cannot start") and mark is not None:
        found = text.splitlines()[mark.line][mark.column : mark.column + 1]
        return (
            "a tab; YAML is indented with spaces alone"
            if found == "\t"
            else f"a value cannot begin with `{found}`; put it into quotes"
        )
    for theirs, ours in _CAUSES.items():
        if str(error.problem).startswith(theirs.format()):
            return ours.format(began.line + 1 if began else mark.line + 1 if mark else "?")
    if not error.context or began is None:
        return str(error.problem)
    return f"{error.problem} {error.context} that begins in line {began.line + 1}"


_COLLECTION_TAGS = frozenset({"tag:yaml.org,2002:map", "tag:yaml.org,2002:seq"})


_SIGNS = frozenset({"tag:yaml.org,2002:value", "tag:yaml.org,2002:merge"})
"""Tags of `=` and `<<`, which are text where a value stands."""


class _ImpossibleError(DocumentError):
    """A value that has a form, such as that of a date, but not its meaning."""


class Source:
    """A YAML file's data and the positions of its values.

    Attributes:
        file: path of the file, as shown in errors.
        is_followed: true if further YAML documents follow the first, which alone is read.
    """

    def __init__(self, file: Path, text: str) -> None:
        self.file = file
        self._values: dict[KeyPath, yaml.Mark] = {}
        self._keys: dict[KeyPath, yaml.Mark] = {}
        self._texts: dict[KeyPath, str] = {}
        self._impossible: dict[KeyPath, DocumentError] = {}
        self._scalars = YamlLoader("")
        try:
            nodes = compose_yaml(text, MAX_REPEATED)
            node = next(nodes, None)
            self.is_followed = next(nodes, None) is not None
            self._data: Any = None if node is None else self._build(node, ())
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            raise DocumentError([self._yaml_problem(_cause(error, text), mark)]) from error
        except yaml.reader.ReaderError as error:
            line = text.count("\n", 0, error.position) + 1
            message = (
                f"the character {error.character:#04x} is not allowed in YAML (in line {line})"
            )
            raise DocumentError([self._yaml_problem(message, None)]) from error
        except yaml.YAMLError as error:
            raise DocumentError([self._yaml_problem(str(error), None)]) from error
        except RecursionError:
            raise self._error("the document is nested too deeply", None) from None

    @property
    def data(self) -> Any:
        """Plain Python values (dict, list, str, int, float, bool, None, dates).

        Raises:
            DocumentError: a value is impossible, such as the 99th day of a month.
        """
        for error in self._impossible.values():
            raise error
        return self._data

    def at(self, path: KeyPath) -> Any:
        """The value at a path; None if there is none."""
        value = self._data
        for part in path:
            try:
                value = value[part]
            except (TypeError, LookupError):
                return None
        return value

    def text(self, path: KeyPath) -> str | None:
        """The text of a value that YAML reads as something else than text; None for all others."""
        return self._texts.get(path)

    def replace(self, path: KeyPath, value: Any) -> None:
        """Put another value in the place of an existing one."""
        *parents, last = path
        self.at(tuple(parents))[last] = value
        self._impossible.pop(path, None)

    @classmethod
    def read(cls, file: Path) -> Source:
        """Read a file.

        Raises:
            InputError: the file is missing, unreadable or not UTF-8.
            DocumentError: it is not YAML, repeats a key, or its aliases repeat too many values.
        """
        return cls(file, read_text(file))

    def place(self, path: KeyPath, *, key: bool = False) -> Place:
        """Position of a value or its key; if the path does not exist, of its nearest parent."""
        marks = self._keys if key else self._values
        while path:
            mark = marks.get(path) or self._values.get(path)
            if mark is not None:
                return Place(self.file, mark.line + 1, mark.column + 1)
            path = path[:-1]
        return Place(self.file, 1, 1)

    def problem(
        self, path: KeyPath, message: str, remedy: str = "", *, at_key: bool = False
    ) -> Problem:
        """A problem at a path of this document."""
        return Problem(self.place(path, key=at_key), render_path(path), message, remedy)

    def _yaml_problem(self, message: str | None, mark: yaml.Mark | None) -> Problem:
        place = Place(self.file, mark.line + 1, mark.column + 1) if mark else Place(self.file)
        return Problem(place, "", f"not valid YAML: {message}", "")

    def _error(self, message: str, mark: yaml.Mark | None) -> DocumentError:
        place = Place(self.file, mark.line + 1, mark.column + 1) if mark else Place(self.file)
        return DocumentError([Problem(place, "", message)])

    def _build(self, node: yaml.Node, path: KeyPath) -> Any:
        self._values.setdefault(path, node.start_mark)
        for known in (self._texts, self._impossible):  # of a merged mapping
            known.pop(path, None)
        if isinstance(node, yaml.ScalarNode):
            return self._value(node, path)
        if node.tag not in _COLLECTION_TAGS:
            raise self._error(f"the tag `{node.tag}` has no meaning here", node.start_mark)
        if isinstance(node, yaml.SequenceNode):
            return [self._build(item, (*path, i)) for i, item in enumerate(node.value)]
        assert isinstance(node, yaml.MappingNode)  # noqa: S101  # there are three kinds
        return self._build_mapping(node, path)

    def _value(self, node: yaml.ScalarNode, path: KeyPath) -> Any:
        try:
            value = self._scalar(node)
        except _ImpossibleError as error:  # unless it turns out to be text
            value = self._impossible[path] = DocumentError(error.problems)
        if not isinstance(value, str):
            self._texts[path] = node.value
        return value

    def _scalar(self, node: yaml.ScalarNode) -> Any:
        if node.tag in _SIGNS:
            return node.value
        if node.tag not in self._scalars.yaml_constructors:
            raise self._error(f"the tag `{node.tag}` has no meaning here", node.start_mark)
        try:
            value = self._scalars.construct_object(node)
            str(value)  # Python refuses to write numbers of thousands of digits
        except (ValueError, KeyError, OverflowError, AttributeError):
            kind = node.tag.rpartition(":")[2].replace("timestamp", "date").replace("int", "number")
            message = (
                f"`{node.value[:40]}` is an impossible {kind}; if it is text, put it into quotes"
            )
            raise _ImpossibleError(self._error(message, node.start_mark).problems) from None
        return value

    def _build_mapping(self, node: yaml.MappingNode, path: KeyPath) -> dict[Any, Any]:
        self._refuse_duplicates(node)
        self._scalars.flatten_mapping(node)
        result: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                raise self._error("a key must be a plain value", key_node.start_mark)
            key = self._scalar(key_node)
            self._keys[(*path, key)] = key_node.start_mark
            result[key] = self._build(value_node, (*path, key))
        return result

    def _refuse_duplicates(self, node: yaml.MappingNode) -> None:
        seen: dict[str, yaml.Mark] = {}
        for key_node, _ in node.value:
            if not isinstance(key_node, yaml.ScalarNode) or key_node.tag.endswith(":merge"):
                continue
            if key_node.value in seen:
                raise self._error(
                    f"the key `{key_node.value}` occurs twice in one mapping, first in line "
                    f"{seen[key_node.value].line + 1}; YAML would keep only the last",
                    key_node.start_mark,
                )
            seen[key_node.value] = key_node.start_mark

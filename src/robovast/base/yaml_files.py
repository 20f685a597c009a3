"""Reads untrusted YAML, and YAML files that contain a mapping."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from robovast.base.errors import InputError
from robovast.base.file_errors import cause
from robovast.base.safe_paths import MOST, MOST_OF_ALL, read_file

if TYPE_CHECKING:
    _SafeLoader = yaml.SafeLoader
else:  # PyYAML may be built without libyaml; the pure Python loader is slower but equivalent
    _SafeLoader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

_LONGEST_NUMBER = 1000
"""Longest text of a number; the time for reading `1:30:00` grows with the square of its length."""


class YamlLoader(_SafeLoader):
    """The safe loader of PyYAML with bounds for numbers."""

    def _number(self, node: yaml.ScalarNode) -> float:
        if len(node.value) > _LONGEST_NUMBER:
            raise ValueError(f"a number cannot have {len(node.value):,} characters")
        whole = node.tag.endswith(":int")
        value: float = self.construct_yaml_int(node) if whole else self.construct_yaml_float(node)
        return value

    def _sign(self, node: yaml.ScalarNode) -> str:
        text: str = node.value
        return text


for _tag in ("int", "float"):
    YamlLoader.add_constructor(f"tag:yaml.org,2002:{_tag}", YamlLoader._number)
for _tag in ("value", "merge"):  # `=` and `<<` are text where a value stands
    YamlLoader.add_constructor(f"tag:yaml.org,2002:{_tag}", YamlLoader._sign)

_FAULTS = (
    yaml.YAMLError,
    RecursionError,
    ArithmeticError,
    AttributeError,
    LookupError,
    TypeError,
    ValueError,
)
"""Exceptions of PyYAML about invalid text: `!!bool x` raises KeyError."""

MOST_LEVELS = 1000
"""Most levels of nesting; libyaml's parser of trees ends the process at some 20,000."""
MOST_REPEATED = 50_000_000
"""Most values that the aliases of a file may repeat."""
_MOST_MERGED = 1_000_000
"""Most keys that `<<` may copy in one file."""
_MAY_BE_DEEP = re.compile(rf"(?<![ \-?:\0])[ \-?:\0]{{{MOST_LEVELS // 2}}}")
"""So many spaces and indicators as deep blocks need before a value, wherever YAML sees a new line:
also after a lone carriage return, U+0085, U+2028, U+2029 and a byte order mark."""


def _check_depth(content: str | bytes) -> None:
    """Refuse YAML that is nested more than `MOST_LEVELS` deep, before it is made into a tree.

    The parser of events needs no stack. It is asked only where brackets or indentation allow such
    a depth, since it takes a fifth of the time of reading.

    Raises:
        yaml.YAMLError: it is nested too deeply, or is not valid.
    """
    text = content if isinstance(content, str) else content.decode("latin-1")
    if text.count("[") + text.count("{") <= MOST_LEVELS and not _MAY_BE_DEEP.search(text):
        return
    depth = 0
    for event in yaml.parse(content, Loader=YamlLoader):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > MOST_LEVELS:
            raise _refused(event, f"this is nested too deeply, more than {MOST_LEVELS:,} levels")


def compose_yaml(content: str | bytes, most: int = MOST_REPEATED) -> Iterator[yaml.Node]:
    """Compose the trees of the YAML documents in a text; all YAML is read through this function.

    Args:
        content: the text.
        most: how many values the aliases of a document may repeat.

    Raises:
        yaml.YAMLError: the YAML is invalid or nested too deeply, its aliases repeat too many
            values or refer to what they are part of, or `<<` copies too many keys.
        ValueError: it contains characters that YAML does not allow.
        RecursionError: it is nested too deeply.
    """
    _check_depth(content)
    text = content if isinstance(content, str) else content.decode("latin-1")
    has_alias = "&" in text and "*" in text
    for node in yaml.compose_all(content, Loader=YamlLoader):
        if has_alias:
            _Repetition(most).measure(node)
        yield node


def parse_yaml(content: str | bytes) -> Any:
    """Parse the first document of YAML to plain data; others are ignored.

    Raises:
        ValueError: the YAML is invalid.
    """
    try:
        node = next(compose_yaml(content), None)
        return None if node is None else YamlLoader("").construct_document(node)
    except _FAULTS as error:
        raise ValueError(f"not valid YAML: {error}") from error


class _Repetition:
    """Counts what aliases and merges (`<<`) repeat, without following any alias twice."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._merged = 0
        self._sizes: dict[int, tuple[int, int] | None] = {}

    def measure(self, node: yaml.Node) -> tuple[int, int]:
        """The number of values in a node and, if it is merged, of keys that it adds.

        Raises:
            yaml.YAMLError: they are too many.
        """
        if id(node) in self._sizes:
            known = self._sizes[id(node)]
            if known is None:
                raise _refused(node, "an alias (`*name`) refers to a value that contains the alias")
            return known
        self._sizes[id(node)] = None
        values, keys = 1, 1
        if isinstance(node, yaml.SequenceNode):
            inside = list(map(self.measure, node.value))  # one frame for each level
            values += sum(size for size, _ in inside)
            keys = sum(added for _, added in inside)
        elif isinstance(node, yaml.MappingNode):
            keys = 0
            for key, value in node.value:
                size, added = self.measure(value)
                values += size
                if not isinstance(key, yaml.ScalarNode):
                    values += self.measure(key)[0]
                if key.tag.endswith(":merge"):
                    self._merged += added
                    keys += added
                else:
                    keys += 1
        self._sizes[id(node)] = values, keys
        if values - len(self._sizes) > self._most:
            raise _refused(node, f"its aliases (`*name`) repeat more than {self._most:,} values")
        if self._merged > _MOST_MERGED:
            raise _refused(node, f"its merges (`<<`) copy more than {_MOST_MERGED:,} keys")
        return values, keys


def _refused(place: yaml.Node | yaml.Event, problem: str) -> yaml.MarkedYAMLError:
    mark: Any = place.start_mark  # of libyaml or of PyYAML, which are alike
    return yaml.MarkedYAMLError(problem=problem, problem_mark=mark)


def read_mapping(path: Path, most: int = MOST_OF_ALL) -> dict[str, Any]:
    """The mapping in a YAML file; empty if the file is missing or contains something else.

    Raises:
        InputError: the file cannot be read, or has more than `most` bytes.
    """
    try:
        data = parse_yaml(read_file(path, most=most))
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {cause(error)}") from error
    except ValueError as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    return data if isinstance(data, dict) else {}


def read_mapping_leniently(path: Path) -> dict[str, Any]:
    """Like `read_mapping` for a file of one run or variant, but empty if it cannot be read."""
    try:
        return read_mapping(path, MOST)
    except InputError:
        return {}

"""Writes any plain data as YAML, by PyYAML."""

from __future__ import annotations

import re
from typing import Any

import yaml

try:
    from yaml import CSafeDumper as _SafeDumper
except ImportError:  # PyYAML built without libyaml: slower, same result
    from yaml import SafeDumper as _SafeDumper  # type: ignore[assignment]


_OTHER_VALUE = re.compile(
    r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|0o[0-7]+|[yYnN]"
)
"""Text that PyYAML writes without quotes, and that readers of YAML 1.2 or of 1.1 take for a number
or a truth value."""


class _Dumper(_SafeDumper):
    """Writes repeated values in full, without anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        del data
        return True


def _text(dumper: Any, text: str) -> yaml.ScalarNode:
    """Lines as a block, which people can compare; quotes if readers could see another value."""
    style = "|" if "\n" in text else "'" if _OTHER_VALUE.fullmatch(text) else None
    node: yaml.ScalarNode = dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)
    return node


_Dumper.add_representer(str, _text)


def dump_any(data: Any) -> str:
    """YAML in the order of the data, block style, without line folding."""
    text: str = yaml.dump(
        data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=2**31 - 1
    )
    return text

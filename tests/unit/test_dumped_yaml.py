"""YAML is read as it was written, also by readers of YAML 1.2."""

from __future__ import annotations

import re
from datetime import UTC

import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from robovast.base.serialization import dump_yaml

WORDS = st.sampled_from(
    ["y", "No", "ON", "null", "Null", "~", "0b1", "1e5", ".inf", "nan", "_", "a-", "0x1f", "007"]
)
NAMES = st.one_of(
    st.from_regex(r"[A-Za-z_/][A-Za-z0-9_./-]{0,20}", fullmatch=True),
    st.from_regex(r"[0-9a-f]{64}", fullmatch=True),
    st.text(alphabet="ab01 .-_/yno:", max_size=12),
    st.datetimes().map(lambda time: time.replace(tzinfo=UTC).isoformat()),
    WORDS,
)


class CoreSchema(yaml.SafeLoader):
    """Reads as the core schema of YAML 1.2 and the truth values of YAML 1.1 say."""


CoreSchema.yaml_implicit_resolvers = {}
for tag, pattern in (
    ("null", r"null|Null|NULL|~|"),
    ("bool", r"true|True|TRUE|false|False|FALSE|[yYnN]|yes|Yes|YES|no|No|NO|on|On|ON|off|Off|OFF"),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+"),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"),
    ("float", r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)"),
):
    CoreSchema.add_implicit_resolver(
        f"tag:yaml.org,2002:{tag}", re.compile(f"(?:{pattern})$"), None
    )


@settings(max_examples=500, deadline=None)
@given(
    st.one_of(
        NAMES,
        st.sampled_from(["=", "<<", "0o17", "08", "1.5e3", "-.5E-3", "+1", "5.", "e" * 64]),
        st.from_regex(r"[-+]?[0-9eExo._:a-f]{1,12}", fullmatch=True),
        st.from_regex(r"[0-9]{1,40}e[0-9]{23,62}", fullmatch=True),
    )
)
def test_text_is_text_for_every_reader(text: str) -> None:
    written = dump_yaml({"value": text, text: [text]})
    for loader in (yaml.SafeLoader, CoreSchema):
        node = yaml.compose(written, Loader=loader)
        assert isinstance(node, yaml.MappingNode)
        (_, value), (key, items) = node.value
        found = [each.tag for each in (value, key, *items.value)]
        assert found == ["tag:yaml.org,2002:str"] * 3, written

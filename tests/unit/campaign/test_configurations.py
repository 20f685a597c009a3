"""`configurations.yaml` may come from anywhere: whatever is in it, only InputError comes out."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from robovast.base.errors import InputError
from robovast.base.yaml_files import parse_yaml
from robovast.campaign.configurations import read_variants, variant_of
from robovast.campaign.layout import Layout
from robovast.campaign.merge import merge_campaigns

OUT = [
    "..",
    "../x",
    "a/../../x",
    "d/../../../../.ssh/authorized_keys",
    "/etc/passwd",
    "//x",
    "",
    ".",
    "./",
    "a\0b",
    "a\nb",
    "\x1b[2J",
    "\ud800",
    "x" * 256,
    "x/" * 3000 + "x",
    None,
    7,
    ["..", "/x"],
    ["a"],
    {"a": 1},
]
"""What is not the path of a file in a folder."""
NAMES = [*OUT, "a/b", "_config", "_jobs", ".running", ".", True]
"""What is not the name of a configuration's folder."""

KEYS = ["name", "config", "_config_name", "_config_files", "_variations", "factors", "vast", "x"]
leaves = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=6), st.sampled_from(OUT)
)
values = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(
            st.one_of(st.sampled_from(KEYS), st.integers(), st.text(max_size=3)), inner
        ),
    ),
    max_leaves=12,
)


def campaign(folder: Path, content: Any) -> Layout:
    layout = Layout(folder)
    layout.transient.mkdir(parents=True, exist_ok=True)
    layout.configurations.write_text(yaml.dump(content), encoding="utf-8")
    return layout


@pytest.mark.parametrize("name", OUT, ids=repr)
def test_a_file_outside_of_the_folder_is_refused(tmp_path: Path, name: Any) -> None:
    with pytest.raises(InputError, match=r"configurations\.yaml: is damaged: `_config_files\[1\]"):
        variant_of(Layout(tmp_path), {"name": "hall", "_config_files": ["map.yaml", name]})


@pytest.mark.parametrize("name", NAMES, ids=repr)
def test_a_name_that_is_not_one_folder_is_refused(tmp_path: Path, name: Any) -> None:
    with pytest.raises(InputError, match=r"configurations\.yaml: is damaged: `name`"):
        variant_of(Layout(tmp_path), {"name": name})


def test_files_of_other_tools_are_pairs(tmp_path: Path) -> None:
    layout = Layout(tmp_path)
    found = variant_of(layout, {"name": "hall", "_config_files": [["map.yaml", "/gone/map.yaml"]]})
    assert [(file.name, file.source) for file in found.files] == [
        ("map.yaml", layout.variant_config("hall") / "map.yaml")
    ]


@settings(max_examples=300, deadline=None)
@given(values)
def test_no_content_raises_another_error(tmp_path_factory: Any, content: Any) -> None:
    layout = campaign(tmp_path_factory.mktemp("c"), {"vast": "a.vast", "configs": content})
    try:
        variants = read_variants(layout)
    except InputError:
        return
    for variant in variants:
        assert variant.name not in {"", ".", ".."}
        assert "/" not in variant.name
        for file in variant.files:
            assert ".." not in file.source.parts
            assert file.source.is_relative_to(layout.variant_config(variant.name))


def test_aliases_that_repeat_without_end_are_refused() -> None:
    bomb = "a0: &a0 [x, x]\n" + "".join(
        f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]\n" for n in range(1, 40)
    )
    for text in (bomb, "&a [*a]", "a: &a {b: [*a]}"):
        with pytest.raises(ValueError, match="alias"):
            parse_yaml(text)
    assert parse_yaml("a: &a [1, 2]\nb: *a\nc: 2 * 3") == {"a": [1, 2], "b": [1, 2], "c": "2 * 3"}


@pytest.mark.parametrize("configs", [None, 5, [5], [{"name": ["x"]}], [{"name": "../x"}], {"a": 1}])
def test_merging_a_damaged_campaign_is_one_message(tmp_path: Path, configs: Any) -> None:
    layout = campaign(tmp_path / "a-2026-01-01-000000", {"vast": "a.vast", "configs": configs})
    layout.config.mkdir()
    (layout.config / "a.vast").touch()
    with pytest.raises(InputError):
        merge_campaigns([layout.root], tmp_path / "merged-2026-01-01-000000")
    assert not (tmp_path / "merged-2026-01-01-000000").exists()

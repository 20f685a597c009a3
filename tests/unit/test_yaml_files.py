"""Reading YAML that anyone may have written."""

from __future__ import annotations

import re
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robovast.base.errors import DocumentError, InputError
from robovast.base.yaml_files import parse_yaml, read_mapping, read_mapping_leniently
from robovast.model.document.source import Source
from robovast.model.scenario import scenario_defaults

INVALID = ["a: [", "when: 2026-13-01", "!!bool maybe", "!!int ''", "!!timestamp x", "[" * 5000]


@pytest.mark.parametrize("text", INVALID)
def test_whatever_is_not_valid_is_one_kind_of_error(text: str, tmp_path: Path) -> None:
    file = tmp_path / "config.yaml"
    file.write_text(text)

    with pytest.raises(ValueError, match=r"not valid|month"):
        parse_yaml(text)
    with pytest.raises(InputError, match=r"config\.yaml: cannot be read"):
        read_mapping(file)
    assert read_mapping_leniently(file) == {}


DEEP = {
    "brackets": "a: " + "[" * 100_000 + "]" * 100_000,
    "braces": "{a: " * 100_000 + "1" + "}" * 100_000,
    "dashes": "- " * 50_000 + "a",
    "indentation": "".join(f"{' ' * level}a:\n" for level in range(3000)),
    "indentation without columns of its own": "".join(
        f"{' ' * level}a:\n{' ' * level}-\n" for level in range(3000)
    ),
    **{
        f"dashes after {mark!a}": f"a:{mark}{'- ' * 50_000}a"
        for mark in ("\r", "\x85", "\u2028", "\u2029")
    },
    "dashes after a byte order mark": "\ufeff" + "- " * 50_000 + "a",
    "a second document": "a: 1\n---\n" + "[" * 100_000 + "]" * 100_000,
}


@pytest.mark.parametrize("text", DEEP.values(), ids=DEEP)
def test_deep_nesting_is_refused_and_ends_no_process(text: str, tmp_path: Path) -> None:
    """libyaml itself would overflow its stack."""
    with pytest.raises(ValueError, match="nested too deeply, more than 1,000 levels"):
        parse_yaml(text)
    with pytest.raises(DocumentError, match="nested too deeply, more than 1,000 levels"):
        Source(tmp_path / "deep.vast", text)
    for encoding in ("utf-8", "utf-16"):
        with pytest.raises(ValueError, match="nested too deeply, more than 1,000 levels"):
            parse_yaml(text.encode(encoding))


def test_wide_and_long_texts_are_not_deep() -> None:
    wide = "a: [" + "[1], {b: '[[[['}, " * 5000 + "]"
    assert len(parse_yaml(wide)["a"]) == 10_000
    assert parse_yaml("a: |\n" + " " * 600 + "text\n")["a"].strip() == "text"


def test_a_date_that_there_is_not_is_a_text(tmp_path: Path) -> None:
    file = tmp_path / "hall.osc"
    file.write_text("scenario hall:\n    day: string = 2026-13-01\n")

    assert scenario_defaults(file) == {"day": "2026-13-01"}


def test_a_missing_file_and_one_without_a_mapping_are_empty(tmp_path: Path) -> None:
    (tmp_path / "list.yaml").write_text("[1, 2]")
    (tmp_path / "two.yaml").write_bytes("\ufeffa: ä\n---\nb: 2\n".encode())

    assert read_mapping(tmp_path / "none.yaml") == read_mapping(tmp_path / "list.yaml") == {}
    assert read_mapping(tmp_path / "two.yaml") == {"a": "ä"}


@settings(max_examples=40, deadline=None)
@given(st.lists(st.sampled_from(["<<: [{}]", "<<: {{<<: [{}], b: 2}}", "k: [{}]"]), min_size=9))
def test_aliases_and_merges_that_explode_are_refused_at_once(levels: list[str]) -> None:
    lines = ["a0: &a0 {k: 1, l: 2}"]
    for number, level in enumerate(levels[:30], 1):
        inside = level.format(", ".join([f"*a{number - 1}"] * 10))
        lines.append(f"a{number}: &a{number} {{{inside}}}")
    text = "\n".join(lines)
    begin = time.process_time()
    for read in (parse_yaml, lambda text: Source(Path("a.vast"), text)):
        with pytest.raises((ValueError, DocumentError), match=r"repeat more than|copy more than"):
            read(text)
    assert time.process_time() - begin < 2


@pytest.mark.parametrize("text", ["&a [*a]", "&a {b: *a}", "a: &a {<<: *a}", "&a {? *a : 1}"])
def test_values_that_are_part_of_themselves_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="refers to a value that contains the alias"):
        parse_yaml(text)
    with pytest.raises(DocumentError, match="refers to a value that contains the alias"):
        Source(Path("a.vast"), text)


def test_usual_merges_are_read() -> None:
    many = "d: &d {x: 1, y: 2}\n" + "".join(f"c{n}: {{<<: *d, y: {n}}}\n" for n in range(5000))
    assert parse_yaml(many)["c7"] == Source(Path("a.vast"), many).data["c7"] == {"x": 1, "y": 7}


def test_signs_of_yaml_are_text_where_a_value_stands() -> None:
    assert parse_yaml("{a: =, b: [=, <<]}") == {"a": "=", "b": ["=", "<<"]}


@pytest.mark.parametrize(
    "number",
    [
        *("1" + ":1" * 200_000, "1" + ":59" * 100_000 + ".5", "!!int '" + "1:" * 200_000 + "1'"),
        *("!!float '" + "1:" * 200_000 + "1'", "1" * 5000, "0x" + "f" * 5000, "0b" + "1" * 100_000),
    ],
)
def test_long_numbers_are_refused_at_once(number: str) -> None:
    begin = time.process_time()
    with pytest.raises(ValueError, match="not valid YAML: a number cannot have"):
        parse_yaml(f"a: {number}")
    with pytest.raises(DocumentError, match="is an impossible"):
        _ = Source(Path("a.vast"), f"a: {number}").data
    assert time.process_time() - begin < 2
    assert parse_yaml("a: 1:30:00.5\nb: 1:30:00") == {"a": 5400.5, "b": 5400}


def test_all_yaml_is_read_by_one_function() -> None:
    """Except in the script of the containers, which has nothing but PyYAML."""
    root = Path(__file__).parents[2]
    reading = re.compile(
        r"yaml\.(safe_|full_|unsafe_)?(load|compose|scan|parse)(_all)?\(|get_(single_)?(data|node)\("
    )
    found = [
        file.relative_to(root).as_posix()
        for folder in ("src", "cli", "operator")
        for file in (root / folder).rglob("*.py")
        if reading.search(file.read_text(encoding="utf-8"))
    ]
    assert sorted(found) == [
        "src/robovast/base/yaml_files.py",
        "src/robovast/execution/contract/run_scenarios.py",
    ]

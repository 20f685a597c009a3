"""Reading YAML that anyone may have written."""

from __future__ import annotations

from pathlib import Path

import pytest

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

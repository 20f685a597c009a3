"""Reading YAML that anyone may have written."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import InputError
from robovast.base.yaml_files import parse_yaml, read_mapping, read_mapping_leniently
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


def test_a_date_that_there_is_not_is_a_text(tmp_path: Path) -> None:
    file = tmp_path / "hall.osc"
    file.write_text("scenario hall:\n    day: string = 2026-13-01\n")

    assert scenario_defaults(file) == {"day": "2026-13-01"}


def test_a_missing_file_and_one_without_a_mapping_are_empty(tmp_path: Path) -> None:
    (tmp_path / "list.yaml").write_text("[1, 2]")
    (tmp_path / "two.yaml").write_bytes("\ufeffa: ä\n---\nb: 2\n".encode())

    assert read_mapping(tmp_path / "none.yaml") == read_mapping(tmp_path / "list.yaml") == {}
    assert read_mapping(tmp_path / "two.yaml") == {"a": "ä"}

"""What loading a plugin's file does to the folder that it is in."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from robovast.analysis.postprocessing.content import scan
from robovast.base.plugins import load_plugin


def test_nothing_is_written_beside_a_plugins_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    (tmp_path / "own.py").write_text("VALUE = 3\n")
    assert load_plugin("own.py:VALUE", "", tmp_path) == 3
    assert [path.name for path in tmp_path.iterdir()] == ["own.py"]


def test_bytecode_of_what_a_plugin_imports_is_no_change_of_a_campaign(tmp_path: Path) -> None:
    (tmp_path / "tools").mkdir()
    (tmp_path / "tools" / "own.py").write_text("VALUE = 3\n")
    before = scan(tmp_path)
    (tmp_path / "tools" / "__pycache__").mkdir()
    (tmp_path / "tools" / "__pycache__" / "own.cpython-311.pyc").write_bytes(b"\0")
    assert scan(tmp_path) == before
    assert list(before) == ["tools/own.py"]

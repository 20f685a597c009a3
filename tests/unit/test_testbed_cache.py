"""The testbed's cache: what was built is built again when its sources change, and only then."""

from __future__ import annotations

from pathlib import Path

from robovast_testbed import cache


def test_an_import_changes_no_hash_and_an_edit_does(tmp_path: Path) -> None:
    source = tmp_path / "package/module.py"
    source.parent.mkdir()
    source.write_text("a = 1\n")
    before = cache.digest([tmp_path])
    bytecode = source.parent / "__pycache__/module.cpython-311.pyc"
    bytecode.parent.mkdir()
    bytecode.write_bytes(b"made by an import")
    assert cache.digest([tmp_path]) == before
    source.write_text("a = 2\n")
    assert cache.digest([tmp_path]) != before

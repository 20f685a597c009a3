"""The pictures in docs/ are there, are small, and can be taken again."""

from __future__ import annotations

import re
from pathlib import Path

from support.pages import ROOT
from support.pictures import PICTURES, REPORT

FOLDER = ROOT / "docs" / "pictures"
MOST = 600_000
"""Bytes of all pictures together"""

_IMAGE = re.compile(r"!\[([^\]]*)\]\(([^)]+)\)")


def shown() -> list[tuple[str, str, Path]]:
    """Page, text and file of each picture in docs/."""
    pages = sorted((ROOT / "docs").rglob("*.md"))
    found = ((p, *match) for p in pages for match in _IMAGE.findall(p.read_text("utf-8")))
    return [(p.name, text, (p.parent / file).resolve()) for p, text, file in found]


def test_every_picture_that_is_shown_is_there_and_is_described() -> None:
    assert shown()
    for page, text, file in shown():
        assert file.is_file(), f"{page}: {file}"
        assert len(text) > 20, f"{page}: {file} needs a text for those who cannot see it"


def test_the_script_takes_all_pictures_that_are_shown_and_no_others() -> None:
    drawn = re.findall(r"docs/(pictures/\S+\.png)", (ROOT / "scripts" / "pictures").read_text())
    taken = {f"pictures/{picture.file}" for picture in PICTURES} | {f"pictures/{REPORT}", *drawn}
    assert {f"pictures/{file.name}" for _, _, file in shown()} == taken
    assert {f"pictures/{file.name}" for file in FOLDER.iterdir()} == taken


def test_pictures_are_small() -> None:
    assert sum(file.stat().st_size for file in FOLDER.iterdir()) < MOST

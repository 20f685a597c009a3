"""What a campaign says of itself, and what changed since another."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.campaigns.stored import NAME, write, write_campaign

from robovast.evaluation.campaign_inputs import SourceFile, about, changes

LATER = "hall-2026-03-05-090000"
DOCUMENT = """\
metadata: {title: Doors, description: How wide they must be}
execution:
  scenario_file: drive/scenario.osc
  runs: 5
"""


@pytest.fixture
def results(tmp_path: Path) -> Path:
    for name in (NAME, LATER):
        root = write_campaign(tmp_path, name, runs=1, outputs=False)
        write(root / "_config" / "hall.vast", DOCUMENT)
        write(root / "_config" / "drive" / "scenario.osc", "scenario drive:\n")
    return tmp_path


def test_it_has_a_title_a_description_and_its_sources(results: Path) -> None:
    found = about(results, NAME)
    assert (found.title, found.description) == ("Doors", "How wide they must be")
    assert found.sources == [
        SourceFile("hall.vast", DOCUMENT),
        SourceFile("drive/scenario.osc", "scenario drive:\n"),
    ]


@pytest.mark.parametrize("text", ["metadata: [1]\nexecution: 7\n", "{", ""])
def test_a_damaged_document_is_shown_as_it_is(results: Path, text: str) -> None:
    write(results / NAME / "_config" / "hall.vast", text)
    found = about(results, NAME)
    assert (found.title, [source.text for source in found.sources]) == ("", [text])


def test_equal_inputs_have_no_changes(results: Path) -> None:
    assert changes((results, NAME), (results, LATER)) == []


def test_changed_lines_files_and_images_are_told(results: Path) -> None:
    later = results / LATER
    write(later / "_config" / "hall.vast", DOCUMENT.replace("runs: 5", "runs: 9"))
    (later / "_config" / "drive" / "scenario.osc").unlink()
    write(later / "_config" / "new.txt", "x\n")
    (later / "_config" / "map.pgm").write_bytes(b"\xff\x00")
    record = later / "_execution" / "execution.yaml"
    record.write_text(record.read_text().replace("robots/hall:7", "robots/hall:8"))
    listed = changes((results, NAME), (results, LATER))
    found = {change.name: (change.kind, change.lines) for change in listed}
    assert found == {
        "image": ("changed", ["-robots/hall:7", "+robots/hall:8"]),
        "hall.vast": (
            "changed",
            ["@@ -3,2 +3,2 @@", "   scenario_file: drive/scenario.osc", "-  runs: 5", "+  runs: 9"],
        ),
        "drive/scenario.osc": ("removed", ["@@ -1 +0,0 @@", "-scenario drive:"]),
        "new.txt": ("added", ["@@ -0,0 +1 @@", "+x"]),
        "map.pgm": ("added", []),
    }


def test_a_long_difference_is_cut_and_says_so(results: Path) -> None:
    write(results / LATER / "_config" / "long.txt", "line\n" * 1000)
    (found,) = changes((results, NAME), (results, LATER))
    assert (len(found.lines), found.more) == (400, 601)


def test_when_comparing_lines_takes_too_long_it_is_told_which_files_differ(
    results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robovast.evaluation.campaign_inputs._SECONDS", 0.0)
    for number in range(3):
        write(results / NAME / "_config" / f"{number}.txt", "old\n")
        write(results / LATER / "_config" / f"{number}.txt", "new\n")
    found = [(change.name, change.lines) for change in changes((results, NAME), (results, LATER))]
    assert found == [("0.txt", []), ("1.txt", []), ("2.txt", [])]

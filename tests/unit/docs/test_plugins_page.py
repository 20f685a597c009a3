"""What docs/how-to/write-plugins.md teaches works as it stands there."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
import yaml
from support.campaigns.finished import add_run
from support.pages import ROOT, write_files

import robovast
from robovast.base.plugins import load_plugin
from robovast.execution.generate import write_configurations
from robovast.model.expansion import compose

PAGE = "docs/how-to/write-plugins.md"
SCENARIO = """\
scenario corridor:
    width: float = 0.9
    do serial:
        wait elapsed(1s)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "project"
    path.mkdir()
    (path / "scenario.osc").write_text(SCENARIO)
    written = write_files(PAGE, "yaml", path) + write_files(PAGE, "python", path)
    names = ["doors.vast", "widths.py", "doors.py", "clearance.py", "laboratory.py", "reasons.py"]
    assert written == names
    return path


def test_the_variation_type_is_applied(folder: Path, tmp_path: Path) -> None:
    variants = robovast.expand(robovast.load_document(folder / "doors.vast"), tmp_path)
    assert [(v.name, v.parameters["width"]) for v in variants] == [
        ("corridor-1", 0.6),
        ("corridor-2", 0.8),
        ("corridor-3", 1.0),
        ("corridor-4", 1.2),
    ]


def test_parameters_that_follow_from_factors_are_none(folder: Path, tmp_path: Path) -> None:
    document = folder / "doors.vast"
    text = document.read_text().replace("  variations:\n", "  variations:\n  - DOORS\n")
    document.write_text(text.replace("DOORS", "doors.py:DoorVariation: {widths: [0.7]}"))
    first = robovast.expand(robovast.load_document(document), tmp_path)[0]
    assert {name: factor["value"] for name, factor in first.factors.items()} == {
        "door_width": 0.7,
        "wall": "brick",
        "width": 0.6,
    }


def test_a_mistake_is_told_as_the_page_promises(folder: Path) -> None:
    path = folder / "doors.vast"
    path.write_text(path.read_text().replace("narrowest: 0.6", "narrowest: -1"))
    with pytest.raises(robovast.RobovastError, match=r"doors\.vast:7:.*narrowest"):
        robovast.load_document(path)


def test_the_command_and_the_hooks_are_called(folder: Path, tmp_path: Path) -> None:
    campaign = _campaign(folder, tmp_path)
    summary = robovast.open_campaign(campaign).postprocess()
    assert not summary.failures, summary.failures
    with (campaign / "corridor-1" / "0" / "clearance.csv").open() as file:
        assert [*csv.DictReader(file)] == [{"clearance": "0.05"}]
    metadata = yaml.safe_load((campaign / "metadata.yaml").read_text())
    assert metadata["laboratory"] == {"room": "B 12", "campaign": campaign.name}
    doors = {entry["name"]: entry["door"] for entry in metadata["configurations"]}
    assert doors["corridor-1"] == {"narrow": True}
    assert doors["corridor-4"] == {"narrow": False}


def _campaign(folder: Path, tmp_path: Path) -> Path:
    """A campaign that was executed from the page's document."""
    document = robovast.load_document(folder / "doors.vast")
    composition = compose(document, tmp_path)
    campaign = tmp_path / "results" / "doors-2026-01-01-000000"
    write_configurations(document, composition, campaign, timings=True)
    for index, variant in enumerate(composition.variants):
        add_run(campaign, variant.name, 0, index)
    return campaign


def test_the_rule_finds_the_error_that_the_page_shows(folder: Path) -> None:
    rule = load_plugin("reasons.py:last_error", "robovast.failure_reasons", folder)
    assert rule(["started", '{"severity": 3, "text": "no grip"}', "ended"]) == "no grip"
    assert rule(["started"]) is None


def test_each_example_is_about_twenty_lines(folder: Path) -> None:
    for path in folder.glob("*.py"):
        lines = [line for line in path.read_text().splitlines() if line.strip()]
        assert len(lines) <= 26, path.name


def test_the_page_is_known_to_readers() -> None:
    assert "docs/how-to/write-plugins.md" in (ROOT / "README.md").read_text()

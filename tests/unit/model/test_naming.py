"""What makes a folder a campaign."""

from pathlib import Path

import pytest

from robovast.model.naming import holds_campaign


@pytest.mark.parametrize(
    ("path", "is_campaign"),
    [
        ("_execution/x", True),
        ("_config/a.vast", True),
        ("hall-1/0/test.xml", True),
        ("hall-1/_config/x", False),
        ("hall-1/first/test.xml", False),
        ("hall-1/00/test.xml", False),
        ("hall-1/²/test.xml", False),
        ("hall-1/0/run.json", False),
        (".hall-1/0/test.xml", False),
        ("hall-2026-03-04-152130/0/test.xml", False),
    ],
)
def test_a_campaign_is_recognized_by_its_content(
    tmp_path: Path, path: str, is_campaign: bool
) -> None:
    (tmp_path / path).parent.mkdir(parents=True)
    (tmp_path / path).touch()
    assert holds_campaign(tmp_path) is is_campaign


@pytest.mark.parametrize("target", ["x" * 300, "loop", "/nowhere"])
@pytest.mark.parametrize("place", ["_config", "_execution", "hall-1", "hall-1/0"])
def test_links_that_lead_nowhere_make_no_campaign(tmp_path: Path, target: str, place: str) -> None:
    (tmp_path / place).parent.mkdir(exist_ok=True)
    (tmp_path / place).symlink_to("loop" if target == "loop" else target)
    (tmp_path / "loop").symlink_to("loop")
    assert not holds_campaign(tmp_path)

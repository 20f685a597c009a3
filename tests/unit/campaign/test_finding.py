"""Campaigns are told from other folders, and those that no campaign is called as harm nobody."""

from __future__ import annotations

import logging
import os
import shutil
from pathlib import Path

import pytest
import yaml
from support.campaigns.finished import finished_campaign

from robovast.analysis.provenance import write_metadata
from robovast.base.errors import InputError
from robovast.campaign.finding import find_campaigns
from robovast.campaign.importing import import_archive
from robovast.campaign.layout import Layout
from robovast.campaign.merge import merge_campaigns
from robovast.evaluation.campaign_index import CampaignIndex
from robovast.evaluation.campaigns import find_campaigns as shown_campaigns


def test_everybody_takes_the_same_folders_for_campaigns(tmp_path: Path) -> None:
    """A configuration has a `_config`, too."""
    campaign = finished_campaign(tmp_path / "results", 1)
    shutil.copytree(campaign / "c-1", campaign.with_name("c-1"), symlinks=True)
    archive = Path(shutil.make_archive(str(tmp_path / "c-1"), "tar", campaign.parent, "c-1"))

    assert find_campaigns(campaign.parent) == [campaign]
    assert shown_campaigns(campaign.parent) == [campaign.name]
    with pytest.raises(InputError, match="contains no campaign"):
        import_archive(archive, tmp_path / "imported")


@pytest.mark.parametrize("name", [b"x\xff", b"x\x1b[2J", b"x\nall passed"])
def test_they_are_left_out_with_a_warning(
    tmp_path: Path, name: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    campaign = finished_campaign(tmp_path / "results", 3)
    for folder in (campaign, campaign / "c-2"):
        shutil.copytree(folder, folder.with_name(os.fsdecode(name)), symlinks=True)
    with caplog.at_level(logging.WARNING):
        assert find_campaigns(campaign.parent) == [campaign]
    assert len(caplog.messages) == 2
    assert not any("\n" in message or "\x1b" in message for message in caplog.messages)
    runs = [run.parent.name for run in Layout(campaign).run_folders()]
    assert set(runs) == {"c-1", "c-2"}
    data = yaml.safe_load(write_metadata(campaign).read_text())
    assert [item["name"] for item in data["configurations"]] == ["c-1", "c-2"]
    index = CampaignIndex(campaign.parent, campaign.name)
    index.refresh()
    assert [variant.name for variant in index.variants] == ["c-1", "c-2"]
    assert merge_campaigns([campaign], tmp_path / "merged").runs == 3

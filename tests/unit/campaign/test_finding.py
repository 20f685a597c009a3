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
from robovast.campaign.discovery import find_campaigns
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


@pytest.mark.parametrize("name", ["demo", "hall-2026-03-04-132444"])
def test_reports_of_another_tool_are_a_campaign(tmp_path: Path, name: str) -> None:
    run = tmp_path / "results" / name / "hall" / "10"
    run.mkdir(parents=True)
    campaign, results = run.parents[1], run.parents[2]
    if name == "demo":
        with pytest.raises(InputError, match=r"<run number>/test\.xml"):
            find_campaigns(results)
    (run / "test.xml").write_text('<testsuite><testcase name="a"/></testsuite>')

    assert find_campaigns(results) == find_campaigns(campaign) == [campaign]
    assert shown_campaigns(results) == [name]
    archive = Path(shutil.make_archive(str(tmp_path / name), "zip", results, name))
    assert import_archive(archive, tmp_path / "imported").name == name


@pytest.mark.parametrize("path", ["hall/first/test.xml", "hall/1x/test.xml", "_jobs/0/test.xml"])
def test_other_places_of_reports_are_no_runs(tmp_path: Path, path: str) -> None:
    (tmp_path / path).parent.mkdir(parents=True)
    (tmp_path / path).write_text('<testsuite><testcase name="a"/></testsuite>')
    with pytest.raises(InputError, match="contains no campaign"):
        find_campaigns(tmp_path)


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

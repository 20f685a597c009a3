"""The plugin `zip`: equal bytes for equal files, the filters of the manual, no file of others."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.faults.small_disk import small_disk

from robovast.analysis.publication.context import PublicationCampaign, PublicationContext
from robovast.analysis.publication.zip_archive import zip_results
from robovast.base.errors import InputError, StorageError
from robovast.campaign.importing import import_archive

NAME = "my camp-2026-03-05-121530"


@pytest.fixture
def campaign(tmp_path: Path) -> PublicationCampaign:
    root = tmp_path / "results" / NAME
    files = {
        "_config/my file.vast": "version: 1\n",
        "_config/tool.sh": "#!/bin/sh\n",
        "_execution/execution.yaml": (
            "execution_time: '2026-03-05T12:15:30+00:00'\nrobovast_version: 1.2.3\n"
        ),
        "_jobs/job-1/logs/system.log": "line\n" * 1000,
        "one-1/_config/config.yaml": "config_identifier: A\n",
        "one-1/0/test.xml": "<testsuite/>",
        "one-1/0/out.csv": "a,b\n1,2\n",
        "one-1/0/rosbag2/bag.mcap": "x" * 5000,
        ".running/job-2/half": "",
        ".state.db": "",
        "_config/.env": "PASSWORD=x",
        "metadata.yaml": "metadata:\n  name: x\nconfigurations: []\n",
    }
    for name, content in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
    (root / "_config" / "tool.sh").chmod(0o755)
    (root / "one-1" / "0" / "job").symlink_to("../../_jobs/job-1")
    return PublicationCampaign(root, {"robot_id": "r2d2", "title": "Runs", "license": "Apache-2.0"})


def pack(campaign: PublicationCampaign, **parameters: Any) -> zipfile.ZipFile:
    context = PublicationContext((campaign,), confirm=lambda _: True)
    good, _, files = zip_results(
        str(campaign.path.parent), "", **{"context": context, **parameters}
    )
    assert good
    return zipfile.ZipFile(files[0])


def names(archive: zipfile.ZipFile) -> set[str]:
    assert all(name.startswith(f"{NAME}/") for name in archive.namelist())
    return {name.removeprefix(f"{NAME}/") for name in archive.namelist()}


def test_equal_files_give_equal_bytes(campaign: PublicationCampaign, tmp_path: Path) -> None:
    first = Path(str(pack(campaign).filename)).read_bytes()
    copy = tmp_path / "elsewhere" / NAME
    shutil.copytree(campaign.path, copy, symlinks=True, copy_function=shutil.copyfile)
    (copy / "_config" / "tool.sh").chmod(0o700)
    for path in sorted(copy.rglob("*"), reverse=True):
        os.utime(path, (1, 1), follow_symlinks=False)
    second = Path(str(pack(replace(campaign, path=copy)).filename)).read_bytes()
    assert first == second


def test_all_files_are_packed_unless_told_otherwise(campaign: PublicationCampaign) -> None:
    archive = pack(campaign)
    assert archive.filename == str(campaign.path.with_name(f"{NAME}.zip"))
    assert names(archive) == {
        "_config/my file.vast",
        "_config/tool.sh",
        "_execution/execution.yaml",
        "_jobs/job-1/logs/system.log",
        "one-1/_config/config.yaml",
        "one-1/0/test.xml",
        "one-1/0/out.csv",
        "one-1/0/rosbag2/bag.mcap",
        "one-1/0/job",
        "metadata.yaml",
        "ro-crate-metadata.json",
    }
    assert archive.testzip() is None


def test_an_archive_can_be_unpacked_and_imported(
    campaign: PublicationCampaign, tmp_path: Path
) -> None:
    path = Path(str(pack(campaign).filename))
    subprocess.run(["python3", "-m", "zipfile", "-t", path], check=True, capture_output=True)
    home = import_archive(path, tmp_path / "home")
    assert (home / "one-1" / "0" / "job" / "logs" / "system.log").read_text() == "line\n" * 1000
    assert os.access(home / "_config" / "tool.sh", os.X_OK)
    assert not os.access(home / "_config" / "my file.vast", os.X_OK)


ALWAYS = {"metadata.yaml", "ro-crate-metadata.json"}
FILTERS: dict[str, tuple[dict[str, Any], set[str]]] = {
    "a name": ({"include_filter": ["*.csv"]}, {"one-1/0/out.csv"}),
    "a path": ({"include_filter": ["one-1/*/test.xml"]}, {"one-1/0/test.xml"}),
    "from the campaign on": (
        {"include_filter": ["/_config/*"]},
        {"_config/my file.vast", "_config/tool.sh"},
    ),
    "excluded all the same": (
        {"include_filter": ["/_config/*"], "exclude_filter": ["*.sh"]},
        {"_config/my file.vast"},
    ),
    "nothing": ({"include_filter": []}, set()),
    "without hidden folders": (
        {"include_filter": ["*.vast", "config.yaml"], "omit_hidden": True},
        {"my file.vast", "one-1/config.yaml"},
    ),
}


@pytest.mark.parametrize("what", FILTERS)
def test_filters_choose(campaign: PublicationCampaign, what: str) -> None:
    parameters, expected = FILTERS[what]
    assert names(pack(campaign, **parameters)) == expected | ALWAYS


def test_links_lead_to_the_same_file_without_hidden_folders(
    campaign: PublicationCampaign, tmp_path: Path
) -> None:
    archive = Path(str(pack(campaign, omit_hidden=True, exclude_filter=["config.yaml"]).filename))
    with zipfile.ZipFile(archive) as zipped:
        target = zipped.read(f"{NAME}/one-1/0/job").decode()
    assert (Path("/one-1/0") / target).resolve() == Path("/job-1")


def test_what_would_be_two_files_of_one_name_is_refused(campaign: PublicationCampaign) -> None:
    (campaign.path / "my file.vast").touch()
    with pytest.raises(InputError, match=r"two files would be `my file\.vast`"):
        pack(campaign, omit_hidden=True)


def test_nothing_from_outside_is_packed(campaign: PublicationCampaign, tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text("password")
    run = campaign.path / "one-1" / "0"
    (run / "absolute").symlink_to(secret)
    (run / "relative").symlink_to("../../../../secret")
    os.mkfifo(run / "pipe")
    good, message, files = zip_results(
        str(campaign.path.parent), "", context=PublicationContext((campaign,))
    )
    assert good
    assert "without 2 links that leave the campaign" in message
    assert not {"one-1/0/absolute", "one-1/0/relative", "one-1/0/pipe"} & names(
        zipfile.ZipFile(files[0])
    )


def test_fields_are_merged_into_the_metadata(campaign: PublicationCampaign) -> None:
    archive = pack(campaign, include_filter=[], metadata={"title": "Ours", "description": "D"})
    merged = yaml.safe_load(archive.read(f"{NAME}/metadata.yaml"))
    assert merged == {
        "metadata": {"name": "x", "title": "Ours", "description": "D"},
        "configurations": [],
    }
    assert "title" not in (campaign.path / "metadata.yaml").read_text()


def test_a_campaign_without_metadata_gets_the_fields(campaign: PublicationCampaign) -> None:
    (campaign.path / "metadata.yaml").unlink()
    archive = pack(campaign, metadata={"title": "Ours"})
    assert yaml.safe_load(archive.read(f"{NAME}/metadata.yaml")) == {"metadata": {"title": "Ours"}}


def test_the_crate_describes_the_archive(campaign: PublicationCampaign) -> None:
    fields = {"creators": [{"name": "Ada", "orcid": "0000-0001"}, "Bob"], "keywords": ["a", "b"]}
    archive = pack(campaign, metadata=fields)
    crate = json.loads(archive.read(f"{NAME}/ro-crate-metadata.json"))
    entities = {entity["@id"]: entity for entity in crate["@graph"]}
    root = entities["./"]
    assert entities["ro-crate-metadata.json"]["about"] == {"@id": "./"}
    assert (root["name"], root["datePublished"]) == ("Runs", "2026-03-05")
    assert root["license"] == {"@id": "https://spdx.org/licenses/Apache-2.0"}
    assert root["author"] == [{"@id": "https://orcid.org/0000-0001"}, {"@id": "#Bob"}]
    parts = {part["@id"] for part in root["hasPart"]}
    assert parts == {"_config/", "_execution/", "_jobs/", "one-1/", "metadata.yaml"}
    assert entities["#robovast"]["softwareVersion"] == "1.2.3"
    assert entities["#execution"]["startTime"] == "2026-03-05T12:15:30+00:00"
    references = {item["@id"] for item in [*root["hasPart"], *root["author"], root["mentions"]]}
    assert references <= entities.keys()


def test_the_file_name_takes_metadata_and_the_time(campaign: PublicationCampaign) -> None:
    archive = pack(campaign, filename="data_{robot_id}_{timestamp}.zip", destination="a/b")
    assert archive.filename == str(
        campaign.path.parent / "a" / "b" / "data_r2d2_2026-03-05-121530.zip"
    )


def test_a_wrong_file_name_is_explained(campaign: PublicationCampaign) -> None:
    with pytest.raises(InputError, match=r"\{robot\}.*license, robot_id, timestamp, title"):
        pack(campaign, filename="{robot}.zip")
    with pytest.raises(InputError, match="not a file name"):
        pack(replace(campaign, metadata={"x": "../../evil"}), filename="{x}")


def test_two_campaigns_are_never_packed_into_one_file(campaign: PublicationCampaign) -> None:
    other = replace(campaign, path=campaign.path.with_name("other-2026-03-05-121530"))
    context = PublicationContext((campaign, other))
    for template in ("{timestamp}.zip", "data.zip"):
        with pytest.raises(InputError, match="would both be packed"):
            zip_results(str(campaign.path.parent), "", filename=template, context=context)


class TestWhatExists:
    def pack(
        self, campaign: PublicationCampaign, answer: bool | None = None, **parameters: Any
    ) -> str:
        context = PublicationContext((campaign,))
        if answer is not None:
            context = replace(context, confirm=lambda _: answer)
        return zip_results(str(campaign.path.parent), "", context=context, **parameters)[1]

    def test_is_left_alone_when_it_is_the_same(self, campaign: PublicationCampaign) -> None:
        self.pack(campaign)
        assert "is up to date" in self.pack(campaign)

    @pytest.mark.parametrize(
        ("parameters", "answer", "replaced"),
        [
            ({"overwrite": True}, None, True),
            ({"overwrite": False}, None, False),
            ({}, True, True),
            ({}, False, False),
        ],
    )
    def test_is_replaced_when_that_is_wanted(
        self,
        campaign: PublicationCampaign,
        parameters: dict[str, bool],
        answer: bool | None,
        replaced: bool,
    ) -> None:
        target = campaign.path.with_name(f"{NAME}.zip")
        target.write_text("old")
        self.pack(campaign, answer, **parameters)
        assert (target.read_bytes() != b"old") is replaced

    def test_is_kept_when_nobody_can_be_asked(self, campaign: PublicationCampaign) -> None:
        target = campaign.path.with_name(f"{NAME}.zip")
        target.write_text("old")
        with pytest.raises(StorageError, match="exists already and differs"):
            self.pack(campaign)
        assert target.read_text() == "old"


def test_a_full_disk_leaves_no_half_archive(campaign: PublicationCampaign) -> None:
    (campaign.path / "random.mcap").write_bytes(os.urandom(2**17))
    with small_disk(2**16), pytest.raises(StorageError, match="File too large"):
        pack(campaign)
    assert [path.name for path in campaign.path.parent.iterdir()] == [NAME]


def test_an_interruption_leaves_no_half_archive(campaign: PublicationCampaign) -> None:
    campaign.path.with_name(f"{NAME}.zip").write_text("old")

    def interrupt(path: Path) -> bool:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pack(campaign, context=PublicationContext((campaign,), confirm=interrupt))
    found = {path.name: path for path in campaign.path.parent.iterdir()}
    assert set(found) == {NAME, f"{NAME}.zip"}
    assert found[f"{NAME}.zip"].read_text() == "old"


def test_names_that_are_no_text_are_packed(campaign: PublicationCampaign) -> None:
    (campaign.path / os.fsdecode(b"b\xffd.csv")).write_text("x")
    assert "b\\xffd.csv" in names(pack(campaign))

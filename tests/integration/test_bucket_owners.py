"""A bucket belongs to one Campaign: real pods, a real S3 server, real downloads."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

import pytest
from robovast_testbed.s3 import Server
from support.campaigns.local import make_campaign
from support.campaigns.one_run import open_store
from support.kube.pod_processes import Campaign, Pod

from robovast.base.errors import InputError
from robovast.evaluation.mirror import mirror
from robovast.model.packs import Owner
from robovast.storage.bucket_ownership import OWNER, OtherOwnerError, find_bucket, owner_of
from robovast.storage.download import Silent, download_campaign
from robovast.storage.folder_ownership import folder_for

NAME = "nav-2026-03-01-100000"
PLACES = [("team-a", "nav"), ("team-a", "nav-again"), ("team-b", "nav")]


@pytest.fixture
def campaigns(tmp_path: Path, s3_server: Server) -> Iterator[list[Campaign]]:
    """Three of one name and one second, each with a step of its own."""
    made = []
    for number, (namespace, name) in enumerate(PLACES):
        folder = tmp_path / str(number)
        vast = make_campaign(folder / "source", f'echo {number} >"$3/who"\n[ {number} != 1 ]\n')
        owner = Owner(uid=str(uuid4()), namespace=namespace, name=name, campaign=NAME)
        given = {"campaign": NAME, "owner": owner}
        made.append(Campaign(folder / "mounts", vast, s3_server, given))
    yield made
    for campaign in made:
        campaign.close()


def of_other(campaign: Campaign, other: Campaign) -> Campaign:
    """A campaign that was given the bucket of another one."""
    campaign.change(bucket=other.bucket)
    return campaign


def test_campaigns_of_one_name_and_one_second_share_nothing(campaigns: list[Campaign]) -> None:
    codes = [Pod(campaign).run() for campaign in campaigns]
    assert codes == [0, 10, 0]
    for number, campaign in enumerate(campaigns):
        assert campaign.read("one-1/0/who") == f"{number}\n", "results of another campaign"
        owner = owner_of(campaign.store, campaign.bucket)
        assert owner is not None
        assert (owner.namespace, owner.name) == PLACES[number]
    assert Pod(campaigns[0]).task("purge") == 0
    assert [c.bucket in c.store.buckets() for c in campaigns] == [False, True, True]


@pytest.mark.parametrize("bad", [{"campaign": "../out"}, {"campaign": "."}, {"uid": "../../../x"}])
def test_an_owner_does_not_choose_where_its_campaign_is_written(
    tmp_path: Path, s3_server: Server, bad: dict[str, str]
) -> None:
    store, bucket = open_store(s3_server), f"nav-{uuid4().hex[:10]}"
    owner = {"uid": "u", "namespace": "n", "name": "nav", "campaign": NAME, **bad}
    store.make_bucket(bucket)
    store.put_bytes(bucket, "_transient/owner.json", json.dumps(owner).encode())
    store.put_bytes(bucket, "_config/a.vast", b"version: 1")
    page = tmp_path / "deep/page"
    (page / NAME).mkdir(parents=True)
    (page / NAME / "other").touch()
    assert bucket in mirror(store, page)
    store.delete_bucket(bucket)
    assert not list(tmp_path.rglob("*.vast"))


@pytest.mark.parametrize("command", ["agent", "compose", "finish", "process"])
def test_the_bucket_of_another_campaign_is_left_alone(
    campaigns: list[Campaign], command: str
) -> None:
    assert Pod(campaigns[0]).run() == 0
    before = campaigns[0].objects()
    pod = Pod(of_other(campaigns[2], campaigns[0]))
    assert pod.task(command) == 73, pod.log(command)
    assert "belongs to the Campaign team-a/nav" in pod.message_file.read_text()
    assert campaigns[0].objects() == before


def test_deleting_a_campaign_keeps_the_bucket_of_another(campaigns: list[Campaign]) -> None:
    assert Pod(campaigns[0]).run() == 0
    other = of_other(campaigns[2], campaigns[0])
    pod = Pod(other)
    assert pod.task("purge") == 0, "nothing is left to be removed"
    assert "nothing is removed" in pod.log("purge")
    assert Pod(other).prepare() == 73
    assert campaigns[0].verdicts() == {"one-1/0": "passed"}


def test_deleting_a_campaign_keeps_a_bucket_without_an_owner(campaigns: list[Campaign]) -> None:
    campaign = campaigns[0]
    assert Pod(campaign).run() == 0
    owner = campaign.store.read(campaign.bucket, OWNER)
    assert owner is not None
    campaign.store.delete(campaign.bucket, [OWNER])
    assert Pod(campaign).task("purge") == 0
    assert campaign.verdicts() == {"one-1/0": "passed"}
    campaign.store.put_bytes(campaign.bucket, OWNER, owner)
    assert Pod(campaign).task("purge") == 0
    assert campaign.bucket not in campaign.store.buckets()
    campaign.store.make_bucket(campaign.bucket)
    assert Pod(campaign).task("purge") == 0
    assert campaign.bucket not in campaign.store.buckets()


def test_campaigns_of_one_name_come_home_into_folders_of_their_own(
    campaigns: list[Campaign], tmp_path: Path
) -> None:
    for campaign in campaigns:
        Pod(campaign).run()
    results = tmp_path / "results"
    homes = []
    for campaign in [*campaigns, *campaigns]:  # once more finds the same folders
        home = folder_for(results, NAME, campaign.plan.owner)
        download_campaign(campaign.store, campaign.bucket, home, Silent())
        homes.append(home)
    assert homes[:3] == homes[3:]
    assert homes[0].name == NAME
    assert [(home / "one-1/0/who").read_text() for home in homes[:3]] == ["0\n", "1\n", "2\n"]
    with pytest.raises(OtherOwnerError, match="team-a/nav "):
        download_campaign(campaigns[2].store, campaigns[2].bucket, homes[0], Silent())
    store = campaigns[0].store
    with pytest.raises(InputError, match=campaigns[1].bucket):
        find_bucket(store, NAME)
    assert find_bucket(store, campaigns[1].bucket) == (
        campaigns[1].bucket,
        campaigns[1].plan.owner,
    )
    page = tmp_path / "page"
    page.mkdir()
    mirror(store, page)
    found = {json.loads((p / "_transient/owner.json").read_text())["uid"] for p in page.iterdir()}
    assert found >= {c.plan.owner.uid for c in campaigns}


def test_the_page_forgets_a_campaign_whose_bucket_is_gone_and_nothing_else(
    campaigns: list[Campaign], tmp_path: Path
) -> None:
    for campaign in campaigns[:2]:
        Pod(campaign).run()
    store, page = campaigns[0].store, tmp_path / "page"
    first, second = sorted(campaigns[:2], key=lambda campaign: campaign.bucket, reverse=True)
    (page / "mine-2026-03-05-121530" / "_config").mkdir(parents=True)
    mirror(store, page)
    there = {path.name for path in page.iterdir()}
    gone = folder_for(page, NAME, first.plan.owner).name
    assert gone == NAME, "it is the first that the page has, so that its name becomes free"
    assert folder_for(page, NAME, second.plan.owner).name in there - {NAME}
    store.delete_bucket(first.bucket)
    mirror(store, page)
    assert {path.name for path in page.iterdir()} == there - {gone}


def test_a_local_campaign_of_that_name_is_not_mixed_with_one_of_a_cluster(
    campaigns: list[Campaign], tmp_path: Path
) -> None:
    local = tmp_path / NAME
    (local / "_config").mkdir(parents=True)
    Pod(campaigns[0]).run()
    assert folder_for(tmp_path, NAME, campaigns[0].plan.owner).name != NAME

"""Jobs that bring their ConfigMaps with them to another cluster."""

from __future__ import annotations

import base64
import os
import random
from pathlib import Path
from typing import Any

import pytest
from support.kube.carried_files import inputs_of, shown
from support.kube.fake_cluster import SCENARIO, SETTINGS, accepted

from robovast.base.errors import InputError
from robovast_operator.kube.objects import Object
from robovast_operator.kube.store import JobState
from robovast_operator.kube.untrusted_fields import shaped
from robovast_operator.planning.campaign import Accepted
from robovast_operator.planning.revisions import next_revision
from robovast_operator.planning.shards import first_attempts
from robovast_operator.pods.jobs import (
    campaign_plan,
    files_config_map,
    plan_config_map,
    shard_job,
)
from robovast_operator.pods.self_contained_jobs import carrying, config_maps_of


def made(files: dict[str, str] | None = None, **source: Any) -> tuple[Object, dict[str, Object]]:
    """The first Job of a campaign, and its ConfigMaps."""
    inline = {"files": {"scenario.osc": SCENARIO, **(files or {})}, **source}
    campaign: Accepted = accepted(source={"inline": inline}, queueName="lab")
    revision = next_revision(campaign, [], [], campaign.identity.child("plan-0"))
    assert revision is not None
    (shard,) = first_attempts(campaign.identity, [revision])
    plan = plan_config_map(
        campaign, revision.config_map, campaign_plan(campaign, revision.plan, revision.entries)
    )
    there = [plan, files_config_map(campaign, None)]
    job = shard_job(campaign, SETTINGS, shard)
    return job, {obj["metadata"]["name"]: obj for obj in there if obj is not None}


def test_pods_find_the_same_files_in_the_same_places(tmp_path: Path) -> None:
    files = {"files/step.sh": "#!/bin/sh\n"}
    job, config_maps = made(files, binaryFiles={"maps/hall.pgm": "AAECAw=="})
    assert set(config_maps_of(job)) == set(config_maps)
    carried = carrying(job, config_maps)
    assert config_maps_of(carried) == []
    template = carried["spec"]["template"]
    assert "scenario_file: scenario.osc" in shown(template, "plan")["document.vast"]
    found = inputs_of(template, tmp_path)
    assert {path: file.read_bytes() for path, file in found.items()} == {
        "scenario.osc": SCENARIO.encode(),
        "files/step.sh": b"#!/bin/sh\n",
        "maps/hall.pgm": b"\x00\x01\x02\x03",
    }
    assert os.access(found["files/step.sh"], os.X_OK)
    assert config_maps_of(job), "the Job that was given is as it was"


def test_what_has_no_room_in_a_job_is_refused_with_a_remedy() -> None:
    carrying(*made({"map.txt": "x" * 700_000}))
    noise = base64.b64encode(random.Random(1).randbytes(200_000)).decode()  # noqa: S311
    with pytest.raises(InputError, match=r"bundle or spec\.source\.git"):
        carrying(*made(binaryFiles={"map.png": noise}))


@pytest.mark.parametrize(
    ("managed_by", "elsewhere"),
    [
        (None, False),
        ("kubernetes.io/job-controller", False),
        ("kueue.x-k8s.io/multikueue", True),
    ],
)
def test_a_job_says_whether_its_pods_are_elsewhere(managed_by: str | None, elsewhere: bool) -> None:
    job, _ = made()
    job["metadata"] |= {"uid": "1", "resourceVersion": "1"}
    if managed_by is not None:
        job["spec"]["managedBy"] = managed_by
    assert JobState.of(shaped(job)).elsewhere == elsewhere

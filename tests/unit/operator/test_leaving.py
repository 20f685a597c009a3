"""What is removed with a Campaign; anyone may have written its status."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.kube.fake_cluster import SETTINGS, accepted, campaign

from robovast.model.packs import CampaignPlan
from robovast_operator.effects.inputs import Inputs
from robovast_operator.effects.jobs import Jobs
from robovast_operator.effects.namespace_limits import NamespaceLimitsReader
from robovast_operator.effects.purge import FINALIZER, Purge
from robovast_operator.kube.objects import Identity
from robovast_operator.kube.store import Store
from robovast_operator.kube.untrusted_fields import shaped
from robovast_operator.memory import InputsCache
from robovast_operator.pods.jobs import campaign_plan, plan_config_map

IDENTITY = accepted().identity
OWN = accepted().bucket


OTHER = Identity(IDENTITY.namespace, IDENTITY.name, "another", IDENTITY.created)
"""The Campaign that was backed up."""


@dataclass
class Server:
    """Has some ConfigMaps, and keeps what is created."""

    config_maps: list[Any]
    created: list[Any] = field(default_factory=list)

    async def list(self, path: str, **_: str) -> AsyncIterator[Any]:
        for found in self.config_maps if path.endswith("/configmaps") else ():
            yield found

    async def create(self, path: str, made: Any, *, dry_run: bool = False) -> Any:
        self.created.append(made)
        return made


def restored_plan() -> Any:
    plan = campaign_plan(accepted(), None, ())
    owner = plan.owner and plan.owner.model_copy(update={"uid": OTHER.uid})
    told = plan.model_copy(update={"bucket": "theirs", "owner": owner})
    return shaped(plan_config_map(accepted(), OTHER.child("plan-0"), told))


@pytest.mark.parametrize("restored", [False, True])
@given(bucket=st.sampled_from([OWN, "robovast-bundles", "drive-2026-11-21-070000", "", None]))
def test_a_bucket_that_a_status_names_is_removed_for_its_owner_alone(
    restored: bool, bucket: str | None
) -> None:
    """A user wrote the status, or a backup restored it, perhaps with the plans of then."""
    obj = campaign(storage={"retention": "Delete"})
    obj["metadata"] |= {"finalizers": [FINALIZER], "deletionTimestamp": "2026-11-21T09:00:00Z"}
    obj["status"] = {} if bucket is None else {"bucket": bucket}
    server: Any = Server([restored_plan()] if restored else [])
    inputs = Inputs(server, Store(), SETTINGS, lambda _: None)
    jobs = Jobs(server, Store(), NamespaceLimitsReader(server))
    diagnosis: Any = None  # no Job has failed

    async def purge() -> None:
        begun = await inputs.begun(shaped(obj), InputsCache())
        await Purge(server, SETTINGS, diagnosis, jobs).carry_out(shaped(obj), begun, {})

    asyncio.run(purge())
    config_map, job = server.created
    assert job["metadata"]["name"] == IDENTITY.child("purge")
    plan = CampaignPlan.model_validate_json(config_map["data"]["campaign.json"])
    assert plan.owner is not None
    assert (plan.bucket, plan.owner.uid) == (bucket or OWN, IDENTITY.uid)

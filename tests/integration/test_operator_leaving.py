"""What a Campaign leaves when it goes, on a real API server with fake nodes."""

from __future__ import annotations

import json
import random
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import (
    NewOperator,
    OperatorProcess,
    campaign,
    created,
    finished,
    status,
)
from support.patience import eventually

DELETE = {"storage": {"retention": "Delete"}}
SOURCE = {"configMap": {"name": "files"}}


@pytest.fixture
def operator(new_operator: NewOperator) -> OperatorProcess:
    """An operator that works."""
    made = new_operator()
    made.start()
    return made


class Place:
    """A namespace and what is in it."""

    def __init__(self, cluster: Cluster, namespace: str) -> None:
        self.cluster = cluster
        self.namespace = namespace

    def kubectl(self, *arguments: str) -> str:
        return self.cluster.kubectl(f"--namespace={self.namespace}", *arguments)

    def get(self, kind: str, *name: str) -> Any:
        return self.cluster.get(kind, *name, f"--namespace={self.namespace}")

    def names(self, kind: str) -> set[str]:
        return {item["metadata"]["name"] for item in self.get(kind)["items"]}

    def apply_with_config_map(self, name: str, **spec: Any) -> None:
        """A Campaign whose files are in a ConfigMap."""
        made = campaign(name, self.namespace, 3, 2, **DELETE, **spec)
        scenario = made["spec"]["source"]["inline"]["files"]["scenario.osc"]
        made["spec"]["source"] = SOURCE
        files = {"scenario.osc": scenario}
        config_map = {"apiVersion": "v1", "kind": "ConfigMap", "data": files}
        labels = {"robovast.io/source": "true"}
        meta = {"name": "files", "namespace": self.namespace, "labels": labels}
        self.cluster.apply({**config_map, "metadata": meta}, made)

    def delete(self, *names: str, cascade: str = "background") -> None:
        """Ask for what is named to go, and do not wait."""
        self.kubectl("delete", "--wait=false", f"--cascade={cascade}", *names)

    @contextmanager
    def no_pods(self) -> Iterator[None]:
        """No pod can be made meanwhile."""
        self.kubectl("create", "quota", "none", "--hard=pods=0")
        eventually(
            lambda: "pods" in (self.get("quota", "none").get("status") or {}).get("hard", {})
        )
        yield
        self.kubectl("delete", "quota", "none")

    def purges(self, bucket: str) -> bool:
        """Whether a Job that can start is about to remove that bucket."""
        jobs = [job for job in self.get("jobs")["items"] if "purge" in job["metadata"]["name"]]
        for job in jobs:
            volumes = job["spec"]["template"]["spec"]["volumes"]
            mounted = json.dumps(volumes)
            plan = next(v["configMap"]["name"] for v in volumes if v["name"] == "plan")
            told = json.loads(self.get("configmap", plan)["data"]["campaign.json"])
            return told["bucket"] == bucket and '"files"' not in mounted.replace(
                '"name": "files", "projected"', ""
            )
        return False

    def gone(self, name: str) -> bool:
        return name not in self.names("campaigns")


@pytest.fixture
def place(fake_cluster: Cluster, namespace: str) -> Place:
    return Place(fake_cluster, namespace)


@pytest.mark.parametrize("cascade", ["background", "foreground"])
@pytest.mark.parametrize("down", [False, True], ids=["operator there", "operator down"])
def test_a_bucket_goes_with_its_campaign_whatever_goes_before(
    place: Place, operator: OperatorProcess, cascade: str, down: bool
) -> None:
    place.apply_with_config_map("few")
    eventually(lambda: finished(place.cluster, place.namespace, "few"), told=operator.told)
    bucket = status(place.cluster, place.namespace, "few")["bucket"]
    if down:
        operator.kill()
    with place.no_pods():
        place.delete("configmap/files")
        place.delete("campaign/few", cascade=cascade)
        if down:
            operator.start()
        eventually(lambda: place.purges(bucket), told=operator.told)
        assert not place.gone("few")
    eventually(lambda: place.gone("few"), told=operator.told)


def test_a_bucket_goes_when_its_campaign_is_not_accepted_any_more(
    place: Place, operator: OperatorProcess
) -> None:
    place.apply_with_config_map("few", suspend=True)
    eventually(lambda: status(place.cluster, place.namespace, "few").get("bucket"), 30)
    bucket = status(place.cluster, place.namespace, "few")["bucket"]
    operator.kill()
    copies = {name for name in place.names("configmaps") if name.endswith("-files")}
    place.delete("configmap/files", *(f"configmap/{name}" for name in copies))
    operator.start()

    def rejected() -> bool:
        return status(place.cluster, place.namespace, "few")["state"] == "Rejected"

    eventually(rejected, 30, operator.told)
    with place.no_pods():
        place.delete("campaign/few")
        eventually(lambda: place.purges(bucket), told=operator.told)
    eventually(lambda: place.gone("few"), told=operator.told)


def test_a_bucket_goes_with_a_campaign_that_was_replaced_when_it_had_ended(
    place: Place, operator: OperatorProcess
) -> None:
    """`kubectl replace`, as Argo CD can be told to do, drops what the manifest does not name."""
    made = campaign("few", place.namespace, 3, 2, **DELETE)
    place.cluster.apply(made)
    eventually(lambda: finished(place.cluster, place.namespace, "few"), told=operator.told)
    bucket = status(place.cluster, place.namespace, "few")["bucket"]
    place.cluster.kubectl("replace", "--filename=-", stdin=json.dumps(made))
    eventually(lambda: place.get("campaign", "few")["metadata"].get("finalizers"), 30)
    with place.no_pods():
        place.delete("campaign/few")
        eventually(lambda: place.purges(bucket), told=operator.told)
    eventually(lambda: place.gone("few"), told=operator.told)


def test_a_campaign_that_was_never_accepted_goes_at_once(
    place: Place, operator: OperatorProcess
) -> None:
    place.cluster.apply(
        campaign(
            "few", place.namespace, 3, 2, **{**DELETE, "source": {"configMap": {"name": "no"}}}
        )
    )
    eventually(lambda: status(place.cluster, place.namespace, "few").get("state"), 30)
    operator.kill()
    place.delete("campaign/few")
    eventually(lambda: place.gone("few"), 10)
    assert not created(place.cluster, place.namespace, "jobs")


def addition(namespace: str) -> dict[str, Any]:
    """A Configuration applied by hand."""
    return {
        "apiVersion": "robovast.io/v1beta1",
        "kind": "Configuration",
        "metadata": {"name": "extra", "namespace": namespace},
        "spec": {"campaign": "few", "parameters": [{"x": 7}], "runs": 2},
    }


@pytest.mark.parametrize("down", [False, True], ids=["operator there", "operator down"])
def test_jobs_of_a_configuration_applied_by_hand_go_with_the_campaign(
    place: Place, operator: OperatorProcess, down: bool
) -> None:
    ended(place, operator)
    if down:
        operator.kill()
    place.delete("campaign/few")
    eventually(lambda: not place.names("jobs"), 30, operator.told)
    assert place.names("configurations") == {"extra"}, "what somebody applied is theirs"


@pytest.mark.parametrize("down", [False, True], ids=["operator there", "operator down"])
def test_jobs_of_a_configuration_applied_by_hand_go_with_it(
    place: Place, operator: OperatorProcess, down: bool
) -> None:
    ended(place, operator)
    before = place.names("jobs")
    if down:
        operator.kill()
    place.delete("configuration/extra")
    if down:
        eventually(lambda: "extra" not in place.names("configurations"))
        operator.start()
    eventually(lambda: len(before - place.names("jobs")) == 1, told=operator.told)


def ended(place: Place, operator: OperatorProcess) -> None:
    """A campaign at its end, with a Configuration that was applied by hand."""
    made = campaign("few", place.namespace, 2, 2)  # with the two that are added six, as is told
    place.cluster.apply(made, addition(place.namespace))

    def over() -> bool:
        state = status(place.cluster, place.namespace, "few")
        return state.get("finishedShards") == 2 and state["state"] == "Finished"

    eventually(over, told=operator.told)
    found = place.get("configuration", "extra")
    assert "ownerReferences" not in found["metadata"], "a GitOps tool does not prune what has one"


def test_a_bucket_that_may_not_be_removed_is_told_and_tried_again_when_that_is_asked(
    place: Place, operator: OperatorProcess
) -> None:
    """The Job that removes it comes to its end in vain, as one does that the server refuses."""
    made = campaign("few", place.namespace, 3, 2, **DELETE)
    place.cluster.apply(made)
    eventually(lambda: finished(place.cluster, place.namespace, "few"), told=operator.told)
    with place.no_pods():
        place.delete("campaign/few")
        eventually(lambda: any("purge" in name for name in place.names("jobs")), 30, operator.told)
        (job,) = (name for name in place.names("jobs") if "purge" in name)
        place.kubectl("patch", "job", job, "--patch", '{"spec": {"activeDeadlineSeconds": 1}}')
        told = eventually(lambda: not_purged(place), told=operator.told)
    assert f"kubectl delete job {job}" in told
    assert not place.gone("few")
    place.delete(f"job/{job}")
    eventually(lambda: place.gone("few"), told=operator.told)


def not_purged(place: Place) -> str:
    """Why a bucket is still there, as an Event tells."""
    events = place.get("events", "--field-selector=reason=DeletionIncomplete")["items"]
    return str(events[0]["message"]) if events else ""


@pytest.mark.parametrize("retention", ["Retain", "Delete"])
def test_campaigns_of_one_name_that_come_and_go_in_every_phase_end_as_the_last_one(
    place: Place, new_operator: NewOperator, retention: str
) -> None:
    """Deleted while planned, executed, indexed; a leader dies amid it."""
    chance = random.Random(retention)  # noqa: S311
    names = ("first", "second")
    replicas = [new_operator(f"{name}-{place.namespace}") for name in names]
    for replica in replicas:
        replica.start()
    made = campaign("few", place.namespace, 3, 2, storage={"retention": retention})
    for number in range(6):
        place.cluster.apply(made)
        time.sleep(chance.uniform(0, 4))
        if number == 3:
            replicas[0].kill()
        cascade = chance.choice(["background", "foreground"])
        place.delete("campaign/few", cascade=cascade)
        eventually(lambda: place.gone("few"), 120, replicas[1].told)
    place.cluster.apply(made)
    eventually(lambda: finished(place.cluster, place.namespace, "few"), 120, replicas[1].told)
    (last,) = place.get("campaigns")["items"]
    assert last["status"]["progress"] == "6/6"

    def owners() -> set[str]:
        objects = [*place.get("jobs")["items"], *place.get("configmaps")["items"]]
        labels = (item["metadata"].get("labels", {}) for item in objects)
        return {found["robovast.io/campaign-uid"] for found in labels if len(found) > 1}

    eventually(lambda: owners() == {last["metadata"]["uid"]}, 60, lambda: str(owners()))

"""The pod in which somebody looks into a run."""

from __future__ import annotations

from typing import Any

from support.kube.fake_cluster import SETTINGS, accepted, campaign

from robovast.kubeapi.pod_contract.debug_pod import debug_pod
from robovast.kubeapi.pod_contract.pack_request import PackRequest
from robovast_operator.planning.revisions import next_revision
from robovast_operator.planning.shards import first_attempts
from robovast_operator.pods.jobs import shard_job


def test_it_is_a_pod_of_the_campaign_for_one_run_that_stores_nothing() -> None:
    made = accepted(execution={"timeout": 60, "resources": {"cpu": 2}}, runs=4)
    revision = next_revision(made, (), (), "plan-0")
    assert revision is not None
    (shard,) = first_attempts(made.identity, [revision])
    job = shard_job(made, SETTINGS, shard)
    pod = debug_pod(campaign(), job, 7)
    assert pod["metadata"]["labels"]["robovast.io/role"] == "debug", "the operator looks away"
    spec: dict[str, Any] = pod["spec"]
    commands = {c["name"]: c["command"] for c in (*spec["initContainers"], *spec["containers"])}
    assert commands["fetch"][-3:] == ["fetch", "--run", "7"]
    assert commands["agent"][-1] == "hold"
    before = job["spec"]["template"]["spec"]
    (run,) = (c for c in spec["containers"] if c["name"] == "robovast")
    assert run.pop("env")[-1] == {"name": "ROBOVAST_KEEP_PROCESSES", "value": "1"}
    (of_job,) = (c for c in before["containers"] if c["name"] == "robovast")
    of_job.pop("env", None)
    assert run == of_job, "image and limits are those of the campaign"
    assert before["containers"][1]["command"][-1] != "hold", "the Job is left as it is"
    assert PackRequest.of_pod(pod) is None, "it is not taken for a pod of a Job"
    assert PackRequest(0, run=7).chosen(revision.plan, lambda _: []) == (7, [7])

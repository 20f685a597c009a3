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
    assert commands["agent"][-3:] == ["hold", "--run", "7"]
    before = job["spec"]["template"]["spec"]
    (run,) = (c for c in spec["containers"] if c["name"] == "robovast")
    assert run.pop("env")[-1] == {"name": "ROBOVAST_KEEP_PROCESSES", "value": "1"}
    (of_job,) = (c for c in before["containers"] if c["name"] == "robovast")
    of_job.pop("env", None)
    assert run == of_job, "image and limits are those of the campaign"
    assert "hold" not in before["containers"][0]["command"], "the Job is left as it is"
    assert PackRequest.of_pod(pod) is None, "it is not taken for a pod of a Job"
    assert PackRequest(0, run=7).chosen(revision.plan, lambda _: []) == (7, [7])


def test_it_is_made_of_a_job_of_an_earlier_operator_as_well() -> None:
    """Whose pods had one more container, of the agent's image of then."""
    own = {"image": "agent:1", "command": ["python", "-m", "robovast.agent"]}
    asked = ["fetch", "--first-pack", "0"]
    pod = {
        "initContainers": [{**own, "name": "fetch", "command": [*own["command"], *asked]}],
        "containers": [
            {"name": "robovast", "image": "runs:1", "command": ["bash", "/config/start.sh"]},
            {**own, "name": "agent", "command": [*own["command"], "agent"]},
        ],
    }
    job = {"spec": {"template": {"spec": pod}}}
    spec = debug_pod(campaign(), job, 7)["spec"]
    assert spec["initContainers"][0]["command"][3:] == ["fetch", "--run", "7"]
    assert [c["command"][1:] for c in spec["containers"]] == [
        ["/config/start.sh"],
        ["-m", "robovast.agent", "hold"],
    ]

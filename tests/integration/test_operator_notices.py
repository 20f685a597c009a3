"""Notices of an operator that is killed again and again, on a real API server with fake nodes."""

from __future__ import annotations

import json
import time
from typing import Any

import pytest
from robovast_testbed.errors import StartFailed
from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import ACCOUNT, NewOperator, OperatorProcess, campaign, status
from support.patience import eventually

WRITES = {"create", "update", "patch", "delete"}
CREATE_JOB = ["create", "jobs"]
RECEIVER = {"kind": "ntfy", "urlFrom": {"name": "robovast-phone", "key": "url"}}


@pytest.fixture
def operator(new_operator: NewOperator) -> OperatorProcess:
    """An operator that soon finds and tells that nothing moves; it has not been started."""
    return new_operator(ROBOVAST_STALL_SECONDS="1", ROBOVAST_NOTIFY_SECONDS="2")


def kill_often(operator: OperatorProcess) -> None:
    """A bad day; in the end it is up."""
    for seconds in (1.0, 2.0, 3.0):
        operator.start()
        time.sleep(seconds)
        operator.kill()
    operator.start()


def restart(operator: OperatorProcess) -> None:
    """Kill it once more, and wait until it works."""
    before = operator.told().count("leads")
    operator.kill()
    operator.start()
    eventually(lambda: operator.told().count("leads") > before, 30, operator.told)


def written(cluster: Cluster, since: int, namespace: str) -> list[tuple[str, str, str]]:
    """Verb, resource and name of what the operator wrote in a namespace, by the audit log."""
    found = []
    with cluster.audit_log.open("rb") as file:
        file.seek(since)
        for line in file:
            entry = json.loads(line)
            about: dict[str, str] = entry.get("objectRef") or {}
            done = entry.get("stage") == "ResponseComplete" and entry["verb"] in WRITES
            ours = entry["user"]["username"] == ACCOUNT and about.get("namespace") == namespace
            if done and ours and entry["responseStatus"]["code"] < 300:
                found.append((entry["verb"], about["resource"], about.get("name", "")))
    return found


def made_notices(cluster: Cluster, since: int, namespace: str) -> list[str]:
    """Names of the Jobs for notices that were made."""
    made = [name for *what, name in written(cluster, since, namespace) if what == CREATE_JOB]
    return [name for name in made if "-notify-" in name]


def notify_jobs(cluster: Cluster, namespace: str) -> list[dict[str, Any]]:
    selector = "--selector=robovast.io/role=notify"
    found: Any = cluster.get("jobs", f"--namespace={namespace}", selector)["items"]
    return list(found)


def failures(cluster: Cluster, namespace: str) -> list[str]:
    field = "--field-selector=reason=NotificationFailed"
    found: Any = cluster.get("events", f"--namespace={namespace}", field)["items"]
    return [item["message"] for item in found]


def stalled_since(cluster: Cluster, namespace: str) -> str:
    conditions = status(cluster, namespace, "few")["conditions"]
    (stalled,) = (c for c in conditions if c["type"] == "Stalled" and c["status"] == "True")
    return str(stalled["lastTransitionTime"])


def test_the_end_is_told_by_one_job_over_kills_and_then_costs_nothing(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    begin = fake_cluster.audit_log.stat().st_size
    fake_cluster.apply(campaign("few", namespace, 3, 2, notifications=[RECEIVER]))
    kill_often(operator)
    state = eventually(
        lambda: (s := status(fake_cluster, namespace, "few")).get("notified") and s,
        60,
        operator.told,
    )
    assert state["notified"] == ["finished-1-1"]
    assert state["state"] == "Finished"
    (job,) = notify_jobs(fake_cluster, namespace)
    (container,) = job["spec"]["template"]["spec"]["containers"]
    (order,) = (e["value"] for e in container["env"] if e["name"] == "ROBOVAST_NOTICE")
    assert json.loads(order)["notice"]["runs"]["passed"] == 6
    eventually(lambda: notify_jobs(fake_cluster, namespace)[0]["status"].get("succeeded"), 30)
    restart(operator)
    quiet = fake_cluster.audit_log.stat().st_size
    fake_cluster.kubectl("--namespace", namespace, "label", "campaign", "few", "looked=at")
    fake_cluster.kubectl("--namespace", namespace, "delete", "jobs", "--all")
    time.sleep(3)
    assert made_notices(fake_cluster, begin, namespace) == [job["metadata"]["name"]]
    assert written(fake_cluster, quiet, namespace) == []


def test_lasting_trouble_is_told_once_and_so_is_that_nobody_could_be_told(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    begin = fake_cluster.audit_log.stat().st_size
    nowhere = {"nodeSelector": {"no": "node"}}
    fake_cluster.apply(
        campaign("few", namespace, 3, 2, notifications=[RECEIVER], scheduling=nowhere)
    )
    kill_often(operator)
    eventually(lambda: status(fake_cluster, namespace, "few").get("notified"))
    assert status(fake_cluster, namespace, "few")["notified"] == ["stalled-1-Unschedulable"]
    pods: Any = eventually(
        lambda: fake_cluster.get(
            "pods", f"--namespace={namespace}", "--selector=robovast.io/role=notify"
        )["items"],
        30,
    )
    end_badly(fake_cluster, namespace, pods[0]["metadata"]["name"])
    (told,) = eventually(lambda: failures(fake_cluster, namespace), 30, operator.told)
    assert told == (
        "A notification could not be sent: the Secret `phone` is not there. Check "
        "spec.notifications."
    )
    since = stalled_since(fake_cluster, namespace)
    restart(operator)
    time.sleep(2)
    assert stalled_since(fake_cluster, namespace) == since
    assert failures(fake_cluster, namespace) == [told]
    assert len(made_notices(fake_cluster, begin, namespace)) == 1
    assert status(fake_cluster, namespace, "few")["state"] == "Stalled"


def end_badly(cluster: Cluster, namespace: str, pod: str) -> None:
    """What a kubelet would say of a pod that found no Secret; it waits for a node here."""
    moment = "2026-01-01T00:00:00Z"
    ended = {
        "exitCode": 65,
        "reason": "Error",
        "message": "the Secret `phone` is not there\n",
        "startedAt": moment,
        "finishedAt": moment,
    }
    container = {
        "name": "notify",
        "image": "agent",
        "imageID": "agent",
        "ready": False,
        "restartCount": 0,
        "state": {"terminated": ended},
    }
    patch = {"status": {"phase": "Failed", "containerStatuses": [container]}}
    cluster.kubectl(
        *("--namespace", namespace, "patch", "pod", pod, "--subresource=status"),
        *("--type=merge", f"--patch={json.dumps(patch)}"),
    )


@pytest.mark.parametrize(
    ("receiver", "said"),
    [
        ({"kind": "ntfy"}, "exactly one address: `url` or `urlFrom`"),
        (
            {**RECEIVER, "url": "https://ntfy.example/topic"},
            "exactly one address: `url` or `urlFrom`",
        ),
        ({"kind": "mail", "url": "https://a/b"}, "Unsupported value"),
        ({"kind": "ntfy", "url": "javascript:alert()"}, "should match"),
    ],
)
def test_kubectl_refuses_a_receiver_that_cannot_be_told(
    fake_cluster: Cluster, namespace: str, receiver: dict[str, Any], said: str
) -> None:
    with pytest.raises(StartFailed, match=said):
        fake_cluster.apply(campaign("few", namespace, 3, 2, notifications=[receiver]))

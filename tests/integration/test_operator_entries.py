"""The objects of a campaign's entries, on a real API server with fake nodes."""

from __future__ import annotations

import json
from collections import Counter
from typing import Any

from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import ACCOUNT, NewOperator, campaign, condition, finished
from support.patience import eventually

ENTRIES = 300


def many_entries(namespace: str) -> dict[str, Any]:
    """A Campaign of one run for each entry."""
    made = campaign("hunted", namespace, 1, 1)
    entries = [{"name": f"e{number}", "parameters": [{"x": number}]} for number in range(ENTRIES)]
    made["spec"]["vast"] |= {"configuration": entries}
    made["spec"]["vast"]["execution"]["runs_per_job"] = 30
    return made


def writes(cluster: Cluster, namespace: str) -> list[str]:
    """What the operator wrote in a namespace, in order, as "VERB RESOURCE"."""
    found = []
    for line in cluster.audit_log.read_text().splitlines():
        entry = json.loads(line) if f'"namespace":"{namespace}"' in line else {}
        about = entry.get("objectRef", {})
        done = entry.get("stage") == "ResponseComplete" and entry["user"]["username"] == ACCOUNT
        if done and entry["verb"] in {"create", "patch"}:
            part = f"/{about['subresource']}" if "subresource" in about else ""
            found.append(f"{entry['verb']} {about['resource']}{part}")
    return found


def test_the_first_job_of_a_document_of_many_entries_waits_for_none_of_their_objects(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """An entry costs one write when it begins and one when it ends: no status can be created."""
    operator = new_operator()
    operator.start()
    fake_cluster.apply(many_entries(namespace))

    def told() -> bool:
        """Whether each entry has its verdict."""
        found: Any = fake_cluster.get("configurations", f"--namespace={namespace}")
        runs = [(item.get("status") or {}).get("runs", {}) for item in found["items"]]
        return len(runs) == ENTRIES and all(run.get("passed") == 1 for run in runs)

    eventually(lambda: finished(fake_cluster, namespace, "hunted"), told=operator.told)
    eventually(told, told=operator.told)
    done = writes(fake_cluster, namespace)
    assert done.index("create jobs") < done.index("create configurations")
    assert done.count("create configurations") == ENTRIES
    assert done.count("patch configurations/status") == ENTRIES


def apply_addition(cluster: Cluster, namespace: str, name: str) -> None:
    """Apply a Configuration that adds a run to the Campaign `few`."""
    cluster.apply(
        {
            "apiVersion": "robovast.io/v1beta1",
            "kind": "Configuration",
            "metadata": {"name": name, "namespace": namespace},
            "spec": {"campaign": "few", "parameters": [{"x": 7}], "runs": 1},
        }
    )


def said(cluster: Cluster, namespace: str) -> Counter[tuple[str, str]]:
    """What the Configurations of a namespace say: their conditions' status and reason."""
    found: Any = cluster.get("configurations", f"--namespace={namespace}")
    own = [item for item in found["items"] if "ownerReferences" not in item["metadata"]]
    told = [condition(item.get("status") or {}, "Accepted") for item in own]
    return Counter((one.get("status", ""), one.get("reason", "")) for one in told)


def test_a_configuration_says_which_campaign_it_waits_for_until_that_answers(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """Applied by hand, each costs one write for what it waits for, however often that is seen."""
    operator = new_operator()
    operator.start()

    def all_say(number: int, *told: str) -> None:
        eventually(lambda: said(fake_cluster, namespace) == {told: number}, told=operator.told)

    for number in range(3):
        apply_addition(fake_cluster, namespace, f"more-{number}")
    all_say(3, "Unknown", "CampaignNotFound")

    wrong = campaign("few", namespace, 1, 3)
    wrong["spec"]["vast"]["execution"]["scenario_file"] = "missing.osc"
    fake_cluster.apply(wrong)
    all_say(3, "Unknown", "CampaignNotAccepted")

    fake_cluster.apply(campaign("few", namespace, 1, 3))
    all_say(3, "True", "Valid")
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)

    before = len(writes(fake_cluster, namespace))
    fake_cluster.kubectl("delete", "campaign", "few", f"--namespace={namespace}")
    all_say(3, "Unknown", "CampaignNotFound")
    apply_addition(fake_cluster, namespace, "late")
    all_say(4, "Unknown", "CampaignNotFound")
    since = Counter(writes(fake_cluster, namespace)[before:])
    assert since["patch configurations/status"] == 4

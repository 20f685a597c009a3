"""What `kubectl describe` tells of a campaign, on a real API server."""

from __future__ import annotations

import re

from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import NewOperator, campaign, finished
from support.patience import eventually


def test_a_failing_campaign_is_told_from_its_plan_to_its_results_in_about_ten_lines(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """Although its operator is killed in between, nothing is told twice."""
    operator = new_operator()
    operator.start()
    fake_cluster.apply(campaign("sour", namespace, 20, 3, parallelism=5))

    def told() -> list[str]:
        described = fake_cluster.kubectl("-n", namespace, "describe", "campaign", "sour")
        lines = described.rpartition("Events:")[2].splitlines()
        return [line for line in lines if "robovast-operator" in line]

    eventually(lambda: any("RunFailed" in line for line in told()), told=operator.told)
    operator.kill()
    after = new_operator("two")
    after.start()
    eventually(lambda: finished(fake_cluster, namespace, "sour"), told=after.told)
    reasons = [line.split()[1] for line in told()]
    assert sorted(set(reasons)) == sorted(
        {
            *("Valid", "Planned", "JobCreated", "RunFailed", "RunsUnsuccessful"),
            *("TooManyUnsuccessfulRuns", "Finished", "Indexed"),
        }
    )
    assert 8 <= len(reasons) <= 10
    text = "\n".join(told())
    assert "The campaign has 60 runs in 60 jobs, and uses at most 5 pods concurrently." in text
    assert re.search(r"The operator created the Job sour-\S+\.", text)
    assert "Run one-1/0 failed: goal not reached." in text
    assert "0 of 60 runs passed; spec.acceptance requires all." in text

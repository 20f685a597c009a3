"""What is told of a campaign by Events: its way in few lines, however many runs it has."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from support.kube.fake_cluster import World, accepted

from robovast.campaign.verdict import Verdict
from robovast.kubeapi.pod_contract.messages import LIMIT, BadRun, Verdicts
from robovast.kubeapi.status import CampaignStatus, Runs
from robovast_operator.pods.first_failures import mishaps_of
from robovast_operator.pods.observations import Mishap
from robovast_operator.snapshot import Snapshot
from robovast_operator.status.progress_events import progress_events

BAD = BadRun(run="hall-1/0", verdict="failed", reason="too slow")


class Told(World):
    """A campaign whose pods say why their runs are bad."""

    mishaps = tuple(
        Mishap("RunFailed", f"hall-1/{n}", "Run hall-1 failed: too slow.") for n in range(3)
    )

    def snapshot(self) -> Snapshot:
        found = super().snapshot()
        return replace(found, pods=replace(found.pods, mishaps=self.mishaps))

    def tell(self, verdict: str, steps: int) -> list[str]:
        """Reasons of the Events, of which one of each subject is kept, as by the API server."""
        told: dict[tuple[str, str], None] = {}
        for step in range(steps):
            decision = self.look(dies="before" if step % 7 == 3 else "")
            told |= {(event.reason, event.about): None for event in decision.events}
            self.work(verdict, step)
        return [reason for reason, _ in told]


def test_a_campaign_all_of_whose_runs_fail_is_told_in_few_lines() -> None:
    world = Told(accepted(runs=400, parallelism=10))
    world.plan_more()
    told = world.tell("failed", 1500)
    assert world.status.runs.failed == 1200
    assert told[:3] == ["Planned", "JobCreated", "RunFailed"]
    assert told.count("RunFailed") == 3
    assert told.count("RunsUnsuccessful") == 3, "at 10, 100 and 1000"
    assert len(told) == 8


def test_a_bad_run_is_told_when_its_pod_says_so_after_its_job_has_counted_it() -> None:
    def status(**runs: int) -> CampaignStatus:
        return CampaignStatus(runs=Runs(total=8, **runs))

    mishaps = [Mishap("RunErrored", "hall-1/2", "Run hall-1/2 errored: ended by SIGKILL.")]
    found = World(accepted()).snapshot()
    found = replace(found, pods=replace(found.pods, mishaps=mishaps))
    counted, said = status(failed=2, undecided=2), status(failed=2, errored=2)
    told = [event.about for event in progress_events(replace(found, status=counted), said)]
    assert "1 hall-1/2" in told
    more = status(failed=2, errored=3)
    told = [event.about for event in progress_events(replace(found, status=said), more)]
    assert "1 hall-1/2" not in told, "the first were told"


def test_of_runs_that_pass_only_plan_and_job_are_told() -> None:
    world = Told(accepted(runs=2))
    world.plan_more()
    assert world.tell("passed", 20) == ["Planned", "JobCreated"]
    world.ask(runs=3)
    assert world.tell("passed", 10) == [], "the generation is the same: nobody asked"


def pod(number: int, said: str = "", **status: Any) -> dict[str, Any]:
    ended = {"exitCode": 10, "message": said}
    return {
        "metadata": {
            "name": f"drive-0-{number}",
            "creationTimestamp": f"2026-01-01T00:00:{number:02}Z",
        },
        "spec": {"nodeName": "n1"},
        "status": {
            "phase": "Failed",
            "containerStatuses": [{"name": "agent", "state": {"terminated": ended}}],
            **status,
        },
    }


def test_the_first_bad_runs_are_named_with_their_reasons() -> None:
    said = Verdicts.of({0: Verdict.FAILED}, bad=[BAD]).text
    found = mishaps_of([pod(3, said), pod(1, said), pod(2, said), pod(4, said)])
    assert [one.about for one in found] == ["hall-1/0"] * 3
    assert found[0] == Mishap("RunFailed", "hall-1/0", "Run hall-1/0 failed: too slow.")


@pytest.mark.parametrize(
    ("status", "told"),
    [
        ({"reason": "Evicted", "message": "low on disk"}, "a pod (Evicted): low on disk."),
        (
            {"containerStatuses": [
                {"name": "robovast", "state": {"terminated": {"reason": "OOMKilled"}}}
            ]},
            "needed more than the memory of the node, because the container has no memory limit",
        ),
        ({}, "failed without a report: the agent ended with exit code 10."),
        ({"containerStatuses": []}, "failed without a report: the pod has no agent."),
    ],
)  # fmt: skip
def test_a_pod_that_was_ended_by_force_says_why(status: dict[str, Any], told: str) -> None:
    (found,) = mishaps_of([pod(1, **status)])
    assert (found.reason, found.about) == ("PodFailed", "drive-0-1")
    assert told in found.message


def test_reasons_never_cost_a_verdict_its_room() -> None:
    """Of a pod with many scattered bad runs and reasons that nobody can spell shortly."""
    verdicts = dict.fromkeys(range(10**6, 10**6 + 900, 2), Verdict.FAILED)
    long = [BAD.model_copy(update={"reason": "ä" * 40, "run": "r" * 250})] * 3
    for count in (3, 900):
        some = dict(list(verdicts.items())[:count])
        said = Verdicts.of(some, bad=long)
        assert len(json.dumps({**json.loads(said.text), "error": "x" * 1490})) <= LIMIT
        assert Verdicts.read(said.text) == said
    assert Verdicts.of({1: Verdict.FAILED}, bad=[BAD]).bad == (BAD,)

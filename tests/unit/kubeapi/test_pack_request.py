"""Which runs a pod executes, from what the operator asked it."""

from __future__ import annotations

from typing import Any

import pytest

from robovast.kubeapi.pod_contract.pack_request import (
    AGENT,
    FETCH,
    INDEX_ANNOTATION,
    PackRequest,
)
from robovast.model.packs import Block, PlanSpec

PLAN = PlanSpec(blocks=(Block(first_variant=0, variants=3, runs=4),), runs_per_job=5)


def pod(request: PackRequest, earlier: bool = False) -> dict[str, Any]:
    """Of this operator, or of one whose pods had a container more for that."""
    program, other = ["python", "-m", "robovast.agent"], {"name": "other"}
    if earlier:
        command = [*program, FETCH, *request.arguments]
        spec = {
            "initContainers": [other, {"name": FETCH, "command": command}],
            "containers": [other, {"name": AGENT, "command": [*program, AGENT, "--silence", "9"]}],
        }
    else:
        command = [*program, AGENT, *request.arguments, "--silence", "9"]
        spec = {"initContainers": [other], "containers": [{"name": AGENT, "command": command}]}
    return {"metadata": {"annotations": {INDEX_ANNOTATION: str(request.index)}}, "spec": spec}


@pytest.mark.parametrize("earlier", [False, True])
@pytest.mark.parametrize(
    "asked", [PackRequest(0), PackRequest(500, 3), PackRequest(2, 1, 4, "0123abcd")]
)
def test_a_pod_tells_what_it_was_asked(asked: PackRequest, earlier: bool) -> None:
    assert PackRequest.of_pod(pod(asked, earlier)) == asked


def test_its_runs_are_those_of_its_pack_or_of_its_group_of_bad_runs() -> None:
    assert PackRequest(1, 1).chosen(PLAN, lambda _: [])[1] == range(10, 12)
    number, ids = PackRequest(0, 1, 2, "list").chosen(PLAN, lambda _: [(1, 7), (9, 9)])
    assert (number, ids) == (1, [6, 7])
    with pytest.raises(IndexError):
        PackRequest(3).chosen(PLAN, lambda _: [])


@pytest.mark.parametrize(
    "other",
    [
        {"metadata": {}, "spec": {}},
        {"metadata": {"annotations": {INDEX_ANNOTATION: "0"}}, "spec": {"initContainers": []}},
        {
            "metadata": {"annotations": {INDEX_ANNOTATION: "x"}},
            "spec": {"containers": [{"name": AGENT, "command": ["--first-pack", "1"]}]},
        },
    ],
)
def test_a_pod_of_others_tells_nothing(other: dict[str, Any]) -> None:
    assert PackRequest.of_pod(other) is None


def test_each_run_has_the_id_that_leads_back_to_it() -> None:
    blocks = (*PLAN.blocks, Block(first_variant=0, variants=3, first_run=4, runs=2))
    plan = PlanSpec(blocks=blocks, runs_per_job=5)
    assert [plan.id_of(*plan.run(id_)) for id_ in range(plan.total)] == list(range(18))
    with pytest.raises(IndexError):
        plan.id_of(3, 0)
    with pytest.raises(IndexError):
        plan.id_of(0, 6)

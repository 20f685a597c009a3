"""The work queue, and what pods tell."""

from __future__ import annotations

import asyncio
import json
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from robovast.campaign.verdict import Verdict
from robovast.kubeapi.pod_contract.messages import Composed, Verdicts
from robovast.kubeapi.pod_contract.pod_facts import Sightings
from robovast.kubeapi.status import Condition
from robovast_operator.kube.conditions import dated
from robovast_operator.kube.events import messages
from robovast_operator.kube.untrusted_fields import shaped
from robovast_operator.kube.work_queue import WorkQueue, work
from robovast_operator.pods.pod_status import is_stuck, sighted, trouble_of
from robovast_operator.pods.reports import composed_of, final_of, given_up_of, reports_of
from robovast_operator.pods.verdicts import Report


def pod(index: int, *statuses: dict[str, Any], created: str = "2026-01-01T00:00:00Z") -> Any:
    annotations = {"batch.kubernetes.io/job-completion-index": str(index)}
    labels = {"robovast.io/role": statuses[0]["name"]} if statuses else {}
    metadata = {"annotations": annotations, "labels": labels, "creationTimestamp": created}
    return shaped({"metadata": metadata, "status": {"containerStatuses": list(statuses)}})


def ended(name: str, code: int, message: str = "") -> dict[str, Any]:
    return {"name": name, "state": {"terminated": {"exitCode": code, "message": message}}}


def test_a_key_is_looked_at_once_however_often_it_changes() -> None:
    async def scenario() -> list[tuple[str, str]]:
        queue, seen = WorkQueue(), []
        for _ in range(100):
            queue.add(("ns", "a"))
        queue.add(("ns", "b"), 0.01)

        async def look(key: tuple[str, str]) -> None:
            seen.append(key)

        task = asyncio.create_task(work(queue, look))
        async with asyncio.timeout(60):
            while ("ns", "b") not in seen:
                await asyncio.sleep(0.01)
        task.cancel()
        return seen

    assert asyncio.run(scenario()) == [("ns", "a"), ("ns", "b")]


def test_a_key_is_never_looked_at_by_two_workers_at_once() -> None:
    async def scenario() -> int:
        queue, busy, most = WorkQueue(), 0, 0

        async def look(key: tuple[str, str]) -> None:
            nonlocal busy, most
            del key
            busy += 1
            most = max(most, busy)
            await asyncio.sleep(0.02)
            busy -= 1

        tasks = [asyncio.create_task(work(queue, look)) for _ in range(3)]
        for _ in range(10):
            queue.add(("ns", "a"))
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.1)
        for task in tasks:
            task.cancel()
        return most

    assert asyncio.run(scenario()) == 1


def test_failures_are_tried_again_later_and_later() -> None:
    async def scenario() -> list[float]:
        queue = WorkQueue()
        return [queue.add_failed(("ns", "a")) for _ in range(12)]

    delays = asyncio.run(scenario())
    assert 0.8 <= delays[0] <= 1.2
    assert 240 <= delays[-1] <= 360
    assert delays[3] > delays[1]


def test_the_last_pod_of_an_index_counts() -> None:
    first = pod(3, ended("agent", 75, '{"passed": "", "failed": "9", "errored": ""}'))
    last = pod(
        3,
        ended("agent", 10, '{"passed": "9", "failed": "10", "errored": ""}'),
        created="2026-01-01T00:05:00Z",
    )
    report = reports_of([last, first])[3]
    assert (report.passed, report.failed, report.errored) == (1, 1, 0)
    assert report.failed_ids == ((10, 10),)


def test_a_message_that_was_cut_counts_all_the_same() -> None:
    """Of a pack of 1,000 of which 95 failed, scattered; older agents do not count."""
    verdicts = dict.fromkeys(range(99000, 100000), Verdict.PASSED)
    verdicts |= dict.fromkeys(range(99003, 99953, 10), Verdict.FAILED)
    said = Verdicts.of(verdicts)
    assert said.truncated
    report = reports_of([pod(0, ended("agent", 10, said.text))])[0]
    assert (report.passed, report.failed, report.errored) == (905, 95, 0)
    older = said.model_copy(update={"counts": None})
    report = reports_of([pod(0, ended("agent", 10, older.text))]).get(0, Report())
    assert (report.passed, report.errored) == (0, 0)


def test_an_exit_code_alone_says_that_one_run_was_bad() -> None:
    assert reports_of([pod(0, ended("agent", 10))]) == {0: Report(failed=1, stored=True)}
    assert reports_of([pod(0, ended("agent", 11))]) == {0: Report(errored=1, stored=True)}


def test_runs_that_a_later_pod_may_have_stored_are_undecided() -> None:
    told = ended("agent", 75, '{"passed": "0", "failed": "", "errored": ""}')
    silent = pod(0, ended("agent", 137), created="2026-01-01T00:05:00Z")
    assert reports_of([pod(0, told)])[0].final
    assert not reports_of([silent, pod(0, told)])[0].final


@pytest.mark.parametrize("message", ["", "killed", "[]", '{"passed": "x"}', '{"passed": 3}'])
def test_a_pod_without_a_report_says_nothing(message: str) -> None:
    assert reports_of([pod(0, ended("agent", 137, message))]) == {}


def test_an_incompatible_image_comes_before_every_other_cause() -> None:
    waiting = {"name": "agent", "image": "x", "state": {"waiting": {"reason": "ErrImagePull"}}}
    found = trouble_of([pod(0, waiting), pod(1, ended("compat-version", 78, "both numbers"))])
    assert found is not None
    assert (found.reason, found.final) == ("IncompatibleImage", True)
    assert found.message == "Container compat-version failed: both numbers."


def test_a_pod_that_no_node_takes_says_so() -> None:
    stuck = pod(0)
    stuck["status"]["conditions"] = [
        {"type": "PodScheduled", "status": "False", "message": "0/1 nodes are available"}
    ]
    found = trouble_of([stuck])
    assert found is not None
    assert (found.reason, found.final) == ("Unschedulable", False)
    assert "0/1 nodes" in found.message


def test_the_finish_job_has_the_last_word() -> None:
    told = {"total": 3, "passed": 1, "failed": 2, "errored": 0, "failedRuns": "1-2"}
    final = final_of(
        [pod(0, ended("finish", 1, "x")), pod(0, ended("finish", 0, json.dumps(told)))]
    )
    assert final is not None
    assert (final.runs.failed, final.failed, final.truncated) == (2, [(1, 2)], False)
    assert final_of([pod(0, ended("finish", 0, "{}"))]) is None


def test_a_compose_job_gives_counts_or_its_message() -> None:
    said = '{"counts": [2, 3], "breaks": "1", "digest": "ab"}'
    assert composed_of([pod(0, ended("compose", 0, said))]) == Composed(
        counts=(2, 3), breaks="1", digest="ab"
    )
    assert (
        composed_of([pod(0, ended("compose", 65, '{"error": "bad.vast: no"}'))]) == "bad.vast: no"
    )
    assert composed_of([pod(0, ended("compose", 1, "Killed"))]) == "Killed"
    assert composed_of([]) is None


def test_a_compose_job_that_was_given_up_says_how_its_last_container_ended() -> None:
    killed = ended("compose", 137)
    killed["state"]["terminated"]["reason"] = "OOMKilled"
    crashed = ended("compose", 1, "Traceback …\nKeyError: 'x'")
    times = [f"2026-01-01T00:0{minute}:00Z" for minute in range(3)]
    pods = [pod(0, crashed, created=times[0]), pod(0, killed, created=times[1])]
    found = given_up_of("lab", "drive-compose", [*reversed(pods)])
    assert found is not None
    assert found.reason == "OutOfMemory"
    assert found.message == (
        "Job drive-compose failed after 2 pods. The last cause: Container compose needs more than "
        "the memory of the node, because the container has no memory limit. Raise the limit, or "
        "use a node with more memory. After you have fixed the cause, run `kubectl delete job -n "
        "lab drive-compose`, so that the operator creates the Job again."
    )
    found = given_up_of("lab", "drive-compose", [*pods, pod(0, crashed, created=times[2])])
    assert found is not None
    assert found.reason == "ContainerError"
    assert "The last cause: Container compose failed (exit code 1: Traceback" in found.message
    wrong = pod(0, ended("compose", 65, '{"error": "bad.vast: no"}'), created=times[2])
    assert given_up_of("lab", "drive-compose", [*pods, wrong]) is None, "its own message says it"
    done = pod(0, ended("compose", 0, '{"counts": [1]}'), created=times[2])
    assert given_up_of("lab", "drive-compose", [*pods, done]) is None


def later(condition: Condition) -> Condition:
    """The same, found out on another day."""
    return condition.model_copy(update={"last_transition_time": "2026-01-03T00:00:00Z"})


def test_each_change_of_a_condition_is_told_once() -> None:
    before = dated(
        [("Accepted", "True", "Valid", "Fine."), ("Passed", "Unknown", "Running", "")],
        1,
        "2026-01-01T00:00:00Z",
        [],
    )
    after = dated(
        [("Accepted", "True", "Valid", "Fine."), ("Passed", "False", "TooMany", "2 of 3.")],
        1,
        "2026-01-02T00:00:00Z",
        before,
    )
    assert [(m.kind, m.reason, m.text) for m in messages(before, after)] == [
        ("Warning", "TooMany", "2 of 3.")
    ]
    (again,) = messages(before, [later(c) for c in after])
    assert again.about == next(messages(before, after)).about, "of one change there is one Event"
    assert list(messages(after, after)) == []
    assert after[0].last_transition_time == "2026-01-01T00:00:00Z"
    assert after[1].last_transition_time == "2026-01-02T00:00:00Z"


def test_the_error_of_a_report_is_told_as_text() -> None:
    report = json.dumps({"passed": "", "failed": "", "errored": "", "error": "no server at x"})
    found = trouble_of([pod(0, ended("agent", 74, report))])
    assert found is not None
    assert (found.reason, found.message) == ("StorageUnavailable", "No server at x.")


def test_a_deleted_pod_that_its_job_holds_for_long_is_stuck() -> None:
    moment = datetime(2026, 1, 1, 0, 5, tzinfo=UTC)
    held = pod(0)
    held["metadata"] |= {
        "deletionTimestamp": "2026-01-01T00:00:00Z",
        "finalizers": ["batch.kubernetes.io/job-tracking"],
    }
    held["status"]["phase"] = "Failed"
    assert is_stuck(held, moment)
    assert not is_stuck(held, moment - timedelta(minutes=4, seconds=30))
    held["status"]["phase"] = "Running"
    assert not is_stuck(held, moment)
    assert not is_stuck(pod(0), moment)


def test_what_is_seen_of_a_pod_is_the_image_of_its_run_and_that_it_lacked_memory() -> None:
    def seen(image: object, reason: str = "Completed", container: str = "robovast") -> Sightings:
        status = {"name": container, "imageID": image, "state": {"terminated": {"reason": reason}}}
        pod = {"metadata": {"name": "p"}, "status": {"containerStatuses": [status]}}
        return sighted(shaped(pod))

    image = "localhost:5000/runs@sha256:" + "1" * 64
    assert seen(image) == Sightings({"p": image})
    assert seen(f"docker-pullable://{image}") == Sightings({"p": image})
    assert seen("sha256:" + "2" * 64) == Sightings({"p": "sha256:" + "2" * 64})
    assert seen(image, "OOMKilled").out_of_memory == {"p"}
    assert not seen(image, "OOMKilled", "agent")
    for nonsense in ("", None, 3, "runs:latest", "sha256:12", "a b@sha256:" + "1" * 64):
        assert not seen(nonsense)

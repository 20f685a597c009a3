"""Parses the termination messages of our own containers. Pure functions.

Anybody may have written them: an invalid message counts as none.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

from robovast.base.ranges import count, merge, parse_ranges
from robovast.kubeapi.pod_contract.exit_codes import AgentExit
from robovast.kubeapi.pod_contract.messages import (
    Composed,
    Proposed,
    Repeat,
    Summary,
    Verdicts,
    error_in,
)
from robovast.kubeapi.status import FAILING_LIMIT, Runs
from robovast.model.packing import PackSample
from robovast.model.repetition import GroupSizes
from robovast_operator.kube.objects import Object
from robovast_operator.kube.times import parse_time
from robovast_operator.kube.untrusted_fields import ranges, time
from robovast_operator.pods.observations import Final, Trouble
from robovast_operator.pods.own import ending_of, has_verdict
from robovast_operator.pods.pod_status import index_of, message_of, trouble_of
from robovast_operator.pods.verdicts import Report

_ALL_STORED = {
    AgentExit.PASSED: Report(passed=1, stored=True),
    AgentExit.FAILED: Report(failed=1, stored=True),
    AgentExit.ERRORED: Report(errored=1, stored=True),
}
"""Reports of a single run by the exit code of the agent alone."""


def reports_of(pods: Iterable[Object]) -> dict[int, Report]:
    """Return the reports of a Job's ended pods by completion index; the last pod counts.

    Runs that the last pod of a failed index leaves without a verdict never get one.
    """
    found: dict[int, Report] = {}
    for pod in sorted(pods, key=lambda pod: str(pod["metadata"]["creationTimestamp"])):
        index, report = index_of(pod), _report(pod)
        if index < 0:
            continue
        if report is not None:
            found[index] = report
        elif index in found:
            found[index] = replace(found[index], final=False)
    return found


def _report(pod: Object) -> Report | None:
    """Return the verdicts in an agent's termination message; None if a verdict is uncertain."""
    message = Verdicts.read(message_of(pod, "agent"))
    if message is None:
        return _ALL_STORED.get(ending_of(pod, "agent").get("exitCode", -1))
    try:
        passed, failed, errored = (
            merge(parse_ranges(ids)) for ids in (message.passed, message.failed, message.errored)
        )
    except ValueError:
        return None
    counts = message.counts
    if counts is None and not message.truncated:
        counts = (count(passed), count(failed), count(errored))
    if counts is None:
        return None
    listed = (tuple(failed), tuple(errored))
    return Report(*counts, *listed, message.not_needed or 0, final=True, stored=has_verdict(pod))


def sample_of(pod: Object) -> PackSample | None:
    """Return the times of an ended pod and of its runs; None if the message has no times."""
    message = Verdicts.read(message_of(pod, "agent"))
    began, ended = pod["status"].get("startTime"), ending_of(pod, "agent").get("finishedAt")
    if (
        message is None
        or message.executed is None
        or message.seconds is None
        or not (began and ended)
    ):
        return None
    seconds = (parse_time(time(ended)) - parse_time(time(began))).total_seconds()
    return PackSample(message.executed, message.seconds, max(seconds, message.seconds))


def final_of(pods: Iterable[Object]) -> Final | None:
    """Return what the finish Job's pod found in the bucket."""
    messages = (Summary.read(message_of(pod, "finish")) for pod in pods)
    return next((_final(summary) for summary in messages if summary and _is_whole(summary)), None)


def _is_whole(message: Summary) -> bool:
    return (
        message.passed + message.failed + message.errored + (message.not_needed or 0)
        == message.total
    )


def _final(message: Summary) -> Final:
    stored = message.total if message.stored is None else min(message.total, message.stored)
    return Final(
        Runs(
            total=message.total,
            passed=message.passed,
            failed=message.failed,
            errored=message.errored,
            stored=stored,
            not_needed=message.not_needed or 0,
        ),
        ranges(message.failed_runs, message.total),
        ranges(message.errored_runs, message.total),
        message.truncated,
        message.failing[:FAILING_LIMIT],
        *_list(message.repeat, message.failed + message.errored),
        decisions=message.decisions or "",
    )


def _list(repeat: Repeat | None, bad: int) -> tuple[str, str]:
    """Return the name of the list of unsuccessful runs and the group sizes, if the sum is right."""
    if repeat is None:
        return "", ""
    try:
        right = GroupSizes.parse(repeat.sizes).runs == bad
    except ValueError:
        right = False
    right = right and len(repeat.list) == 16 and repeat.list.isalnum()
    return (repeat.list, repeat.sizes) if right else ("", "")


def composed_of(pods: Iterable[Object]) -> Composed | str | None:
    """Return the result of the compose Job, or the message of a failed Job."""
    return _result_of(pods, "compose", Composed)


def proposed_of(pods: Iterable[Object]) -> Proposed | str | None:
    """Return the result of a propose Job, or the message of a failed Job."""
    return _result_of(pods, "propose", Proposed)


def given_up_of(namespace: str, job: str, pods: Sequence[Object]) -> Trouble | None:
    """Return why a task's Job failed, from its last pod; None if the pod has a result."""
    last = max(pods, key=lambda pod: str(pod["metadata"]["creationTimestamp"]))
    found = trouble_of([last])
    if found is None or found.final:
        return None
    message = (
        f"Job {job} failed after {len(pods)} pods. The last cause: {found.message} "
        f"After you have fixed the cause, run `kubectl delete job -n {namespace} {job}`, so that "
        "the operator creates the Job again."
    )
    return Trouble(found.reason, message)


Result = TypeVar("Result", Composed, Proposed)


def _result_of(pods: Iterable[Object], command: str, kind: type[Result]) -> Result | str | None:
    messages = [message_of(pod, command) for pod in pods]
    made = map(kind.read, messages)
    errors = filter(None, map(error_in, messages))
    return next((found for found in made if found and found.error is None), next(errors, None))

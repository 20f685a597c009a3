"""What a Job that waits in a queue of Kueue means for its campaign. Pure functions."""

from __future__ import annotations

import heapq
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from math import isfinite

from kubernetes.utils.quantity import parse_quantity

from robovast.base.ranges import count
from robovast.kubeapi.status import QueuePlace
from robovast_operator.kube.objects import Object
from robovast_operator.kube.sentences import after_colon, clause
from robovast_operator.kube.store import JobState
from robovast_operator.kube.times import format_time, parse_time
from robovast_operator.kube.untrusted_fields import mappings, number, ranges, shaped, text

PARKED = "robovast.io/parked"
"""Annotation of a Workload that was taken out of its queue because its campaign is suspended."""

_TOO_LARGE = re.compile(
    r"insufficient quota for (\S{1,300}) in flavor (\S{1,300}),.{0,200}?request \(([^)]{1,50})\)"
    r" > maximum capacity \(([^)]{1,50})\)"
)
_LONGEST_MESSAGE = 4096
"""Most characters of a message of Kueue that are parsed."""


@dataclass(frozen=True)
class Waiting:
    """Why Kueue has not admitted a Job yet."""

    job: str
    """Its name."""
    reason: str
    message: str
    helpless: bool = False
    """Whether the Job waits until a user acts."""
    fits: int | None = None
    """Pods that the queue can give at once at most; None when it can give what is asked for."""
    parked: bool = False
    """Whether it was taken out of the queue by us."""
    misled: bool = False
    """Whether it was made for this cluster, and its queue leads to others by now."""
    place: QueuePlace | None = None


@dataclass(frozen=True)
class QueueFindings:
    """Findings of Kueue about a campaign at one moment."""

    waiting: Waiting | None = None
    """Why the oldest Job that waits is not admitted."""
    parked: frozenset[str] = frozenset()
    """Jobs that are out of their queue because the campaign was suspended."""
    again: float | None = None
    """When to look again [s]; None if an event will follow."""


def waiting_of(workload: Object, job: JobState) -> Waiting | None:
    """Return why a Job waits, from its Workload of Kueue; None if the Job has quota."""
    conditions = {c["type"]: c for c in workload["status"].get("conditions", ())}
    reserved = conditions.get("QuotaReserved", {})
    cause = after_colon(reserved.get("message", ""))
    if not workload["spec"].get("active", True):
        return _inactive(workload, job, conditions)
    if not job.queue:
        message = "Kueue holds back Jobs without a queue. Set spec.queueName."
        return Waiting(job.name, "QueueRequired", message, helpless=True)
    if reserved.get("status") == "True":
        return _unchecked(workload, job)
    if reserved.get("reason") == "Inadmissible":
        message = (
            f"Kueue cannot admit the Job {job.name} to queue {job.queue}{cause}. Create or repair "
            "the queue, or set spec.queueName to another queue (`kubectl get localqueues -n "
            f"{job.namespace}`)."
        )
        return Waiting(job.name, "QueueUnavailable", message, helpless=True)
    pods = min(job.parallelism, job.size)
    fits = (
        pods_that_fit(reserved.get("message", ""), pods)
        if _is_about(workload, reserved, pods)
        else None
    )
    if fits == 0:
        message = (
            f"A single run requests more than the quota of queue {job.queue}{cause}. Lower "
            "`execution.resources` in the .vast file, or raise the quota of the queue."
        )
        return Waiting(job.name, "RunExceedsQuota", message, helpless=True)
    message = f"The campaign waits in queue {job.queue}{cause}."
    return Waiting(job.name, "Queued", message, fits=fits)


def _unchecked(workload: Object, job: JobState) -> Waiting | None:
    """Return the admission check that a Job with quota waits for, such as a worker cluster."""
    for check in _checks(workload):
        if check.get("state") != "Ready":
            name, cause = text(check.get("name")), after_colon(text(check.get("message")))
            message = (
                f"The campaign has quota in queue {job.queue} and waits for the admission check "
                f"{name}{cause}."
            )
            return Waiting(job.name, "Queued", message)
    return None


def worker_of(workload: Object) -> str:
    """Return the worker cluster that runs a Workload; empty without a worker cluster."""
    return text(workload["status"].get("clusterName"))


def no_class(job: JobState) -> Waiting:
    """Return the finding that the priority class does not exist."""
    message = (
        f"Kueue has no WorkloadPriorityClass {job.priority}. Create the class, or set "
        "spec.queuePriorityClassName to another class (`kubectl get workloadpriorityclasses`)."
    )
    return Waiting(job.name, "NoPriorityClass", message, helpless=True)


def _inactive(workload: Object, job: JobState, conditions: Mapping[str, Object]) -> Waiting:
    name = workload["metadata"]["name"]
    if PARKED in (workload["metadata"].get("annotations") or {}):
        message = f"Kueue returns the Job {job.name} to queue {job.queue}."
        return Waiting(job.name, "Requeued", message, parked=True)
    if not job.elsewhere and _is_for_others(workload):
        message = (
            f"Queue {job.queue} leads to other clusters. The operator creates the Job {job.name} "
            "again."
        )
        return Waiting(job.name, "Queued", message, misled=True)
    cause = clause(conditions.get("Evicted", {}).get("message") or "spec.active is false")
    message = (
        f"Workload {name} is inactive: {cause}. To queue the Workload again, suspend the Campaign "
        "and then resume the Campaign."
    )
    return Waiting(job.name, "WorkloadInactive", message, helpless=True)


def _is_for_others(workload: Object) -> bool:
    """Return whether MultiKueue rejects a Workload because its Job is for this cluster.

    No field shows this, up to v1beta2 of Kueue 0.16; the message names the field of the Job.
    """
    rejected = (c for c in _checks(workload) if c.get("state") == "Rejected")
    return any("spec.managedBy" in text(check.get("message")) for check in rejected)


def leads_elsewhere(workload: Object) -> bool:
    """Return whether the queue of an admitted Workload may lead to other clusters."""
    return any(_checks(workload))


def _checks(workload: Object) -> Iterable[Object]:
    return mappings(workload["status"].get("admissionChecks"))


def _is_about(workload: Object, condition: Object, pods: int) -> bool:
    """Return whether condition and Workload describe the current Workload and Job."""
    asked = sum(number(s.get("count"), 1) for s in mappings(workload["spec"].get("podSets")))
    generation = workload["metadata"].get("generation")
    return bool(asked == pods and condition.get("observedGeneration") == generation)


def pods_that_fit(message: str, pods: int) -> int | None:
    """Return how many of a Job's pods a queue can hold, from Kueue's refusal of all of them.

    No field of a Workload shows this, up to v1beta2 of Kueue 0.16, so the message is parsed.
    Kueue's maximum counts what can be borrowed, too. Of several flavors the roomiest counts.

    Args:
        message: of the Workload's condition QuotaReserved.
        pods: how many it was asked for.
    """
    flavors: dict[str, list[int]] = {}
    for _, flavor, asked, most in _TOO_LARGE.findall(message[:_LONGEST_MESSAGE]):
        wanted, there = _quantity(asked), _quantity(most)
        if wanted and there is not None:
            flavors.setdefault(flavor, []).append(int(pods * there / wanted + 1e-9))
    return max((min(found) for found in flavors.values()), default=None)


def _quantity(amount: str) -> float | None:
    try:
        found = float(parse_quantity(amount))
    except (ValueError, OverflowError):
        return None
    return found if isfinite(found) else None


def place_of(
    pending: Sequence[Object], job: JobState, running: Iterable[JobState], now: datetime
) -> QueuePlace | None:
    """Return the position of a Job in its queue; None if the Job does not wait in the queue.

    Args:
        pending: items of Kueue's answer about the LocalQueue.
        job: the Job.
        running: stored Jobs that have quota of the same ClusterQueue.
        now: the time.
    """
    position = next((_position(item) for item in pending if _owner(item) == job.uid), None)
    if position is None:
        return None
    last = max(_position(item) for item in pending)
    wait = wait_seconds(position, running, now)
    if wait is None:
        return QueuePlace(position=position, pending=last, summary=f"{position} of {last}")
    return QueuePlace(
        position=position,
        pending=last,
        estimated_start=format_time(now + timedelta(seconds=wait)),
        summary=f"{position} of {last}, {about(wait)}",
    )


def _position(item: Object) -> int:
    """Return 1 is next."""
    return number(item.get("positionInClusterQueue")) + 1


def _owner(item: Object) -> str:
    owners: Sequence[Object] = shaped(item)["metadata"].get("ownerReferences") or [{}]
    return str(owners[0].get("uid", ""))


def wait_seconds(position: int, running: Iterable[JobState], now: datetime) -> float | None:
    """Return the time until running Jobs free quota for a position in the queue [s].

    Each running Job is expected to continue at its pace so far, and each earlier Job to take the
    average time of the running Jobs. Returns None until a running Job has finished an index.
    """
    paces = [pace for job in running if (pace := _pace(job, now)) is not None]
    if not paces:
        return None
    usual = sum(whole for _, whole in paces) / len(paces)
    free = [left for left, _ in paces]
    heapq.heapify(free)
    for _ in range(position - 1):
        heapq.heappush(free, heapq.heappop(free) + usual)
    return heapq.heappop(free)


def _pace(job: JobState, now: datetime) -> tuple[float, float] | None:
    """Return the remaining and the total time of a Job [s]."""
    done = sum(count(ranges(indexes, job.size)) for indexes in (job.completed, job.failed))
    if not done or not job.started:
        return None
    elapsed = max(0.0, (now - parse_time(job.started)).total_seconds())
    whole = elapsed / done * job.size
    return whole - elapsed, whole


def about(seconds: float) -> str:
    """Return a time in words, with limited precision."""
    if seconds < 60:
        return "less than a minute"
    for unit, length, most in (("min", 60, 90), ("h", 3600, 36)):
        if seconds < most * length:
            return f"about {round(seconds / length)} {unit}"
    return f"about {round(seconds / 86400)} d"

"""Why the pods of a Job make no progress. Pure functions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from itertools import chain

from robovast_operator.kube.objects import Object
from robovast_operator.kube.sentences import after_colon
from robovast_operator.kube.store import JobState
from robovast_operator.kube.times import parse_time
from robovast_operator.kube.untrusted_fields import mapping, mappings, ranges, text
from robovast_operator.pods.observations import Trouble
from robovast_operator.pods.own import containers_of, has_verdict
from robovast_operator.pods.pod_status import index_of, most_telling, troubles_of

REPEATED = 3
"""How many pods of one pack die before that is reported."""

RECOVERY = timedelta(minutes=15)
"""A pod that lives for so long [s], and longer than those before, ends a series of deaths."""

LOST_SECONDS = 60.0
"""How long the node of a deleted pod may be silent [s]."""


def cause_of(
    pods: Iterable[Object], job: JobState, moment: datetime, silence: float, *, at_work: bool
) -> Trouble | None:
    """Return why a Job's pods make no progress; None if the pods show no cause.

    Of each open index only the newest pod counts, or the one before it: causes of older pods,
    and of ended indexes, are over.

    Args:
        pods: of the Job, those that succeeded need not be among them.
        job: the Job.
        moment: the time.
        silence: how long runs may write nothing to their logs [s].
        at_work: whether any pods of the campaign are. Then only what others died of again and
            again is in the way.
    """
    tries = [
        [(pod, list(_causes(pod, moment, silence))) for pod in newest_first]
        for newest_first in _open_tries(pods, job)
    ]
    found = most_telling(
        cause
        for pods_of_index in tries
        for cause in next((causes for _, causes in pods_of_index[:2] if causes), [])
    )
    dead = [
        [(pod, causes) for pod, causes in pods_of_index if causes and _is_dead(pod)]
        for pods_of_index in tries
    ]
    deaths = [[parse_time(_created(pod)) for pod, _ in pods_of_index] for pods_of_index in dead]
    number = sum(map(len, deaths))
    repeated = number >= job.active and any(_goes_on(times, moment) for times in deaths)
    if found is None or (at_work and not repeated):
        return None
    if not repeated:
        return replace(found, deadly=any(found in causes for _, causes in chain(*dead)))
    message = f"{number} pods failed without a result. The last cause: {found.message}"
    return replace(found, message=message, deadly=True)


def unseen_cause(job: JobState, worker: str, cluster: Object | None) -> Trouble | None:
    """Return why a Job with pods in a worker cluster of MultiKueue makes no progress.

    Args:
        job: the Job.
        worker: name of the cluster; empty if Kueue has chosen none.
        cluster: its MultiKueueCluster; None if it cannot be read.
    """
    conditions = mappings(mapping(mapping(cluster).get("status")).get("conditions"))
    state = next((c for c in conditions if c.get("type") == "Active"), {})
    if state.get("status") == "False":
        return Trouble(
            "WorkerLost",
            f"Worker cluster {worker} is not responding{after_colon(text(state.get('message')))}. "
            "Stored results are safe. The remaining runs resume when the cluster reconnects, or "
            "when Kueue assigns the runs to another cluster.",
        )
    if job.ready or not worker:
        return None
    selector = f"batch.kubernetes.io/job-name={job.name}"
    return Trouble(
        "NoWorkerPods",
        f"No pod of the Job {job.name} runs in the worker cluster {worker}. To find the cause, "
        f"run `kubectl describe pods -n {job.namespace} -l {selector}` in that cluster.",
    )


def _goes_on(deaths: Sequence[datetime], moment: datetime) -> bool:
    """Return whether pods of an index die in series, each no older than the pods before.

    Args:
        deaths: when those that died were made, the newest first.
        moment: the time.
    """
    if len(deaths) < REPEATED:
        return False
    usual = (deaths[0] - deaths[-1]) / (len(deaths) - 1)
    return moment - deaths[0] < max(RECOVERY, 3 * usual)


def _open_tries(pods: Iterable[Object], job: JobState) -> list[list[Object]]:
    """Return the pods of each index that has not ended, newest first."""
    ended = [*ranges(job.completed, job.size), *ranges(job.failed, job.size)]
    by_index: dict[int, list[Object]] = {}
    for pod in pods:
        index = index_of(pod)
        if not any(first <= index <= last for first, last in ended):
            by_index.setdefault(index, []).append(pod)
    return [sorted(found, key=_created, reverse=True) for found in by_index.values()]


def _created(pod: Object) -> str:
    return str(pod["metadata"].get("creationTimestamp", ""))


def _is_dead(pod: Object) -> bool:
    return bool(pod["status"].get("phase") == "Failed") and not has_verdict(pod)


def _causes(pod: Object, moment: datetime, silence: float) -> Iterator[Trouble]:
    yield from troubles_of(pod)
    if _is_lost(pod, moment):
        node, name = pod["spec"].get("nodeName", "?"), pod["metadata"]["name"]
        yield Trouble(
            "NodeLost",
            f"Node {node} is not responding, so pod {name} cannot terminate, and the runs of the "
            "pod cannot be rescheduled. Restore the node, or remove the node with `kubectl delete "
            f"node {node}`.",
        )
    elif _is_silent(pod, moment):
        name, namespace = pod["metadata"]["name"], pod["metadata"].get("namespace", "")
        yield Trouble(
            "NoLogOutput",
            f"The run in pod {name} has written no log output for {silence / 60:g} min. Read the "
            f"log with `kubectl logs -n {namespace} {name} -c robovast`. If runs can hang, set "
            "`execution.timeout`. To stop this run, delete the pod.",
        )


def may_store(pod: Object, moment: datetime) -> bool:
    """Return whether the agent of a pod may still store results; False without an agent."""
    agents = (c for c in containers_of(pod) if c["name"] == "agent")
    states = [mapping(agent.get("state")) for agent in agents]
    if pod["status"].get("phase") == "Pending":  # another container waits, such as for its image
        return any("running" in state for state in states)
    at_work = any("terminated" not in state for state in states)
    running = bool(pod["status"].get("phase") == "Running")
    return at_work and running and not _is_lost(pod, moment)


def _is_lost(pod: Object, moment: datetime) -> bool:
    """Return whether the node of a pod is lost: not ready, or a deleted pod does not terminate."""
    meta, status = pod["metadata"], pod["status"]
    if status.get("phase") != "Running":
        return False
    ready = _readiness(pod)
    if "deletionTimestamp" in meta:
        return parse_time(meta["deletionTimestamp"]) + timedelta(seconds=LOST_SECONDS) < moment
    # A kubelet gives a reason; the node controller, for lost nodes, changes only the status.
    return ready.get("status") == "False" and not ready.get("reason")


def _is_silent(pod: Object, moment: datetime) -> bool:
    """Return whether the agent is running and the probe reports a run without log output."""
    if pod["status"].get("phase") != "Running" or "deletionTimestamp" in pod["metadata"]:
        return False
    agent: Object = next((c for c in containers_of(pod) if c["name"] == "agent"), {})
    running = (agent.get("state") or {}).get("running")
    since = _readiness(pod).get("lastTransitionTime")
    if agent.get("started") is False:  # it still prepares the run
        return False
    if running is None or agent.get("ready") is not False or not isinstance(since, str):
        return False
    started = running.get("startedAt")
    return isinstance(started, str) and parse_time(started) + timedelta(seconds=60) < moment


def _readiness(pod: Object) -> Object:
    conditions: Sequence[Object] = pod["status"].get("conditions") or ()
    return next((c for c in conditions if c["type"] == "Ready"), {})

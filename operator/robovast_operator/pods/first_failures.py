"""The first runs and pods that went wrong, for people. Pure functions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from robovast.base.printable import one_line
from robovast.kubeapi.pod_contract.messages import BadRun, Verdicts
from robovast.kubeapi.pod_contract.pack_request import RUN
from robovast_operator.kube.objects import Object
from robovast_operator.kube.sentences import clause
from robovast_operator.kube.untrusted_fields import text
from robovast_operator.pods.observations import MISHAPS, Mishap
from robovast_operator.pods.own import ending_of
from robovast_operator.pods.pod_status import memory_limit, message_of, troubles_of


def mishaps_of(pods: Iterable[Object]) -> list[Mishap]:
    """Return the first mishaps of failed pods, the oldest first."""
    found: list[Mishap] = []
    failed = (pod for pod in pods if pod["status"].get("phase") == "Failed")
    for pod in sorted(failed, key=lambda pod: str(pod["metadata"]["creationTimestamp"])):
        found += _mishaps(pod)
        if len(found) >= MISHAPS:
            break
    return found[:MISHAPS]


def _mishaps(pod: Object) -> Iterator[Mishap]:
    """Generate the unsuccessful runs of a pod, and the cause of its failure."""
    verdicts = Verdicts.read(message_of(pod, "agent"))
    for bad in (verdicts.bad or ()) if verdicts is not None else ():
        yield _run(bad)
    name, node = text(pod["metadata"].get("name")), text(pod["spec"].get("nodeName"), "?")
    causes = [trouble.message for trouble in troubles_of(pod)]
    if ending_of(pod, RUN).get("reason") == "OOMKilled":
        causes.append(f"The run needed more than {memory_limit(pod, RUN)}.")
    if causes:
        yield Mishap("PodFailed", name, one_line(f"Pod {name} on node {node} failed. {causes[0]}"))
    elif verdicts is None:
        code = ending_of(pod, "agent").get("exitCode")
        cause = "the pod has no agent" if code is None else f"the agent ended with exit code {code}"
        message = f"Pod {name} on node {node} failed without a report: {cause}."
        yield Mishap("PodFailed", name, message)


def _run(bad: BadRun) -> Mishap:
    reason = "RunFailed" if bad.verdict == "failed" else "RunErrored"
    message = f"Run {bad.run} {bad.verdict}: {clause(bad.reason)}."
    return Mishap(reason, bad.run, one_line(message))

"""Start and follow Jobs that upload a campaign to the file share."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress

from robovast.base.backoff import wait_until
from robovast.base.errors import CannotRunError, InputError, RobovastError, StorageError
from robovast.kubeapi.pod_contract.exit_codes import AgentExit
from robovast.kubeapi.share_job import Upload, share_job, share_secret
from robovast_cli.kube.api import Json, KubernetesClient
from robovast_cli.kube.api_errors import ConflictError, UnreachableError

INTERVAL = 1.0
"""Time between two requests for a Job [s]."""
PATIENCE = 60.0
"""Time limit for the removal of a finished Job [s]."""
JOB_LABEL = "batch.kubernetes.io/job-name"


def start(kube: KubernetesClient, upload: Upload, variables: Mapping[str, str]) -> bool:
    """Start an upload; return False if an upload of the same campaign is in progress.

    Creates a suspended Job first, so that it owns the Secret with the variables of the share.

    Raises:
        RobovastError: the Job or its Secret could not be created; neither remains.
    """
    found = kube.job(upload.job)
    if found is not None:
        if _is_in_progress(found):
            return False
        _remove(kube, upload.job)
    secret = f"{upload.job}-{secrets.token_hex(4)}"
    try:
        job = kube.create_job(share_job(upload, secret))
    except ConflictError:  # another client was faster
        return False
    try:
        kube.create_secret(share_secret(job, secret, variables))
        kube.start_job(upload.job)
    except BaseException:
        kube.delete_job(upload.job)
        raise
    return True


def follow(kube: KubernetesClient, job: str, campaign: str, show: Callable[[str], None]) -> None:
    """Call `show` with each new last line of a Job's log, until the Job has succeeded.

    The API server may be unreachable for some time.

    Raises:
        RobovastError: the Job was deleted or has failed; the message quotes its pod.
    """
    shown = ""
    while True:
        with suppress(UnreachableError):
            found = kube.job(job)
            if found is None:
                raise CannotRunError(
                    f"{campaign}: the Job {job} was deleted during the upload.",
                    hint="run the command again",
                )
            pods = kube.pods({JOB_LABEL: job})
            line = _last_line(kube, pods[-1]) if pods else ""
            if line and line != shown:
                show(line)
                shown = line
            if _has(found, "Complete"):
                return
            if _has(found, "Failed"):
                raise _failure(kube, found, pods, campaign)
        time.sleep(INTERVAL)


def log_command(kube: KubernetesClient, job: str) -> str:
    """Return the command that prints the log of a Job's pod."""
    return f"kubectl --namespace {kube.namespace} logs job/{job}"


def _failure(kube: KubernetesClient, job: Json, pods: list[Json], campaign: str) -> RobovastError:
    """Return an error with the message of the last pod, else with the reason of the Job."""
    name = job["metadata"]["name"]
    ends = [end for pod in reversed(pods) for end in _terminations(pod)]
    last = next((end for end in ends if end.get("message")), None)
    reasons = (item.get("message", "") for item in job["status"]["conditions"])
    message = last["message"] if last else next(filter(None, reasons), "no reason was reported.")
    kind = InputError if last and last.get("exitCode") == AgentExit.BAD_DOCUMENT else StorageError
    return kind(
        f"{campaign} was not uploaded: {str(message).strip()}\n    Its log: "
        f"{log_command(kube, name)}"
    )


def _last_line(kube: KubernetesClient, pod: Json) -> str:
    """Return the last line of a pod's log, else the reason why the pod is pending."""
    if reason := next(_waiting_reasons(pod), ""):
        return reason
    try:
        lines = kube.log_end(pod["metadata"]["name"], 1).splitlines()
    except RobovastError:  # forbidden, not started, or the node does not answer
        return ""
    return lines[-1] if lines else ""


def _waiting_reasons(pod: Json) -> Iterator[str]:
    """Yield the reasons why a pod does not start."""
    status = pod.get("status", {})
    for condition in status.get("conditions") or ():
        if condition["type"] == "PodScheduled" and condition["status"] == "False":
            yield f"its pod is pending: {condition.get('message') or condition.get('reason')}"
    for container in status.get("containerStatuses") or ():
        waiting = container["state"].get("waiting") or {}
        if waiting.get("message"):
            yield f"its pod is pending: {waiting.get('reason')}: {waiting['message']}"


def _terminations(pod: Json) -> Iterator[Json]:
    """Yield the states of terminated containers, and the message of the pod."""
    status = pod.get("status", {})
    for container in status.get("containerStatuses") or ():
        if "terminated" in container["state"]:
            yield container["state"]["terminated"]
    yield {"message": status.get("message", "")}


def _is_in_progress(job: Json) -> bool:
    over = _has(job, "Complete") or _has(job, "Failed")
    return not (over or job["spec"].get("suspend") or job["metadata"].get("deletionTimestamp"))


def _has(job: Json, condition: str) -> bool:
    found = job.get("status", {}).get("conditions") or ()
    return any(item["type"] == condition and item["status"] == "True" for item in found)


def _remove(kube: KubernetesClient, name: str) -> None:
    kube.delete_job(name)
    if not wait_until(lambda: kube.job(name) is None, PATIENCE, INTERVAL):
        raise CannotRunError(
            f"an earlier Job {name} is marked for deletion, but still exists",
            hint=f"check `kubectl --namespace {kube.namespace} describe job {name}`, then run "
            "the command again",
        )

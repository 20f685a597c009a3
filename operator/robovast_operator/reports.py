"""What our own containers say when they end. Pure functions.

Anybody may have written it: what makes no sense is as good as not said.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from robovast.cluster.status import Runs
from robovast_operator.campaign import Object
from robovast_operator.lenient import mapping
from robovast_operator.picture import Final
from robovast_operator.pod_facts import index_of, message_of
from robovast_operator.verdicts import Report, parse_report


def reports_of(pods: Iterable[Object]) -> dict[int, Report]:
    """The verdicts of a Job's failed pods by completion index; of a retried one the last."""
    found: dict[int, tuple[str, Report]] = {}
    for pod in pods:
        index, report = index_of(pod), parse_report(message_of(pod, "agent"))
        if index < 0 or report is None:
            continue
        started = pod["metadata"]["creationTimestamp"]
        known = found.get(index)
        if known is None or known[0] <= started:
            found[index] = (started, report)
    return {index: report for index, (_, report) in found.items()}


def final_of(pods: Iterable[Object]) -> Final | None:
    """What the finish Job's pod found in the bucket."""
    for pod in pods:
        data = _said(pod, "finish")
        try:
            runs = Runs(
                total=data["total"],
                passed=data["passed"],
                failed=data["failed"],
                errored=data["errored"],
                stored=data.get("stored", data["passed"] + data["failed"] + data["errored"]),
            )
            return Final(
                runs,
                data.get("failedRuns", ""),
                data.get("erroredRuns", ""),
                bool(data.get("truncated")),
                tuple(data.get("failing") or ())[:10],
            )
        except (ValueError, KeyError, TypeError):
            continue
    return None


def composed_of(pods: Iterable[Object]) -> tuple[list[int], str] | str | None:
    """Variants by entry and breaks of the compose Job; its message when it failed."""
    error: str | None = None
    for pod in pods:
        message = message_of(pod, "compose")
        data = _said(pod, "compose")
        try:
            if "error" in data:
                error = str(data["error"])
            else:
                return [int(number) for number in data["counts"]], data.get("breaks", "")
        except (ValueError, KeyError, TypeError):
            error = error or message or None
    return error


def _said(pod: Object, container: str) -> dict[str, Any]:
    """The JSON that a container left; empty when it is none."""
    try:
        return mapping(json.loads(message_of(pod, container)))
    except (ValueError, RecursionError):
        return {}

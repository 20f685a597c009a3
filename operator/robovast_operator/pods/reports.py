"""What our own containers say when they end. Pure functions.

Anybody may have written it: what makes no sense is as good as not said.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from robovast.base.ranges import count, merge, parse_ranges
from robovast.kubeapi.status import FAILING_LIMIT, Runs
from robovast.model.repetition import GroupSizes
from robovast_operator.kube.lenient import listed, mapping, number, ranges, text
from robovast_operator.kube.objects import Object
from robovast_operator.planning.composition import Composition
from robovast_operator.pods.findings import Final
from robovast_operator.pods.pod_status import ending_of, index_of, message_of
from robovast_operator.pods.verdicts import Report

_KINDS = ("passed", "failed", "errored")

_ALL_STORED = {10: Report(failed=1), 11: Report(errored=1)}
"""What an agent's exit code alone says of a single run (docs/agent.md)."""


def reports_of(pods: Iterable[Object]) -> dict[int, Report]:
    """What failed pods of a Job said of their runs, by completion index; of several the last.

    Of runs that the last pod of a failed index leaves without a verdict, there will be none.
    """
    found: dict[int, Report] = {}
    for pod in sorted(pods, key=lambda pod: str(pod["metadata"]["creationTimestamp"])):
        index, report = index_of(pod), _report(pod)
        if index < 0:
            continue
        if report is not None:
            found[index] = report
        elif index in found:
            found[index] = _not_final(found[index])
    return found


def _not_final(report: Report) -> Report:
    return Report(
        report.passed, report.failed, report.errored, report.failed_ids, report.errored_ids
    )


def _report(pod: Object) -> Report | None:
    """The verdicts in an agent's last words; None when they say nothing for sure."""
    said = _said(pod, "agent")
    if not all(isinstance(said.get(kind), str) for kind in _KINDS):
        return _ALL_STORED.get(ending_of(pod, "agent").get("exitCode", -1))
    try:
        passed, failed, errored = (merge(parse_ranges(said[kind])) for kind in _KINDS)
    except ValueError:
        return None
    counts = [number(item, -1) for item in listed(said.get("counts"))]
    if "counts" not in said and not said.get("truncated"):
        counts = [count(passed), count(failed), count(errored)]
    if len(counts) != len(_KINDS) or min(counts) < 0:
        return None
    return Report(counts[0], counts[1], counts[2], tuple(failed), tuple(errored), final=True)


def final_of(pods: Iterable[Object]) -> Final | None:
    """What the finish Job's pod found in the bucket."""
    return next((final for pod in pods if (final := _final(_said(pod, "finish")))), None)


def _final(said: dict[str, Any]) -> Final | None:
    total, *counts = (number(said.get(key), -1) for key in ("total", *_KINDS))
    if total < 0 or min(counts) < 0 or sum(counts) != total:
        return None
    passed, failed, errored = counts
    repeat = mapping(said.get("repeat"))
    stored = min(total, number(said.get("stored"), total))
    runs = Runs(total=total, passed=passed, failed=failed, errored=errored, stored=stored)
    return Final(
        runs,
        ranges(said.get("failedRuns"), total),
        ranges(said.get("erroredRuns"), total),
        said.get("truncated") is True,
        tuple(item for item in listed(said.get("failing")) if text(item))[:FAILING_LIMIT],
        *_list(repeat, failed + errored),
    )


def _list(repeat: dict[str, Any], bad: int) -> tuple[str, str]:
    """Name of the list of bad runs, and the sizes of its groups, when they are of so many runs."""
    name, sizes = text(repeat.get("list")), text(repeat.get("sizes"))
    try:
        right = GroupSizes.parse(sizes).runs == bad
    except ValueError:
        right = False
    return (name, sizes) if right and len(name) == 16 and name.isalnum() else ("", "")


def composed_of(pods: Iterable[Object]) -> Composition | str | None:
    """What the compose Job found out; its message when it failed."""
    error: str | None = None
    for pod in pods:
        said = _said(pod, "compose")
        counts = [number(item, -1) for item in listed(said.get("counts"))]
        if "error" not in said and counts and min(counts) >= 0:
            return Composition(counts, text(said.get("breaks")), text(said.get("digest")) or None)
        error = text(said.get("error")) or error or message_of(pod, "compose") or None
    return error


def _said(pod: Object, container: str) -> dict[str, Any]:
    """The JSON that a container left; empty when it is none."""
    try:
        return mapping(json.loads(message_of(pod, container)))
    except (ValueError, RecursionError):
        return {}

"""Decide when to send notifications about a campaign. Pure functions of its status.

The only state is the marks in `status.notified`: a mark is written after the Job that sends the
notification was created, and the Job's name is derived from the mark. So each mark has exactly one
Job, whenever the operator restarts.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Literal

from robovast.kubeapi.notice import Event, Named, Notice
from robovast.kubeapi.resources import Notification, Subject
from robovast.kubeapi.status import NOTIFIED_LIMIT, CampaignStatus, Condition
from robovast_operator.kube.objects import Identity
from robovast_operator.kube.times import format_time, parse_time

_SUBJECTS: dict[Event, frozenset[Subject]] = {
    "Finished": frozenset({"Finished"}),
    "GivenUp": frozenset({"Finished", "Trouble"}),
    "Stalled": frozenset({"Trouble"}),
    "Recovered": frozenset({"Trouble"}),
    "Started": frozenset({"Started"}),
    "Batch": frozenset({"Progress"}),
    "Progress": frozenset({"Progress"}),
}
"""Subjects of each event; each end of a campaign causes one notification."""

HOUR = timedelta(hours=1)
"""Between two notices of progress."""

_GOING = {"Running", "Proposing", "Finishing"}
"""States of a campaign in progress; a campaign that waits in a queue has not started."""


@dataclass(frozen=True)
class Transition:
    """A notice to send."""

    event: Event
    mark: str
    """Unique for each notification of a campaign."""
    since: Condition
    """The condition that causes the notification."""
    lasting: bool = False
    """Whether the condition must last before the notification is sent."""


def due(
    status: CampaignStatus,
    receivers: Sequence[Notification],
    now: datetime,
    lasting: timedelta,
) -> tuple[Transition | None, float | None]:
    """Return the notification to send now, and when to look again without a change [s].

    Args:
        status: of the campaign.
        receivers: the notification targets.
        now: the time.
        lasting: how long trouble must last; much of it passes by itself.
    """
    found = _transition(status)
    if found is None:
        return _next_milestone(status, receivers, now)
    if found.mark in status.notified or not interested(found, receivers):
        return None, None
    if found.lasting:
        wait = (parse_time(found.since.last_transition_time) + lasting - now).total_seconds()
        if wait > 0:
            return None, wait
    return found, None


def interested(transition: Transition, receivers: Sequence[Notification]) -> list[Notification]:
    """Return the notification targets that subscribe to a notification."""
    return _interested(transition.event, receivers)


def _interested(event: Event, receivers: Sequence[Notification]) -> list[Notification]:
    subjects = _SUBJECTS[event]
    return [receiver for receiver in receivers if subjects.intersection(receiver.subjects)]


def marked(status: CampaignStatus, transition: Transition) -> CampaignStatus:
    """Return the status with the mark of a notification; one mark per kind of milestone."""
    kept = [mark for mark in status.notified if not _is_replaced(mark, transition)]
    return status.model_copy(update={"notified": [*kept, transition.mark][-NOTIFIED_LIMIT:]})


def _is_replaced(mark: str, transition: Transition) -> bool:
    """Return whether a mark is of an earlier milestone of the same kind."""
    kind = transition.event.lower()
    return kind in {"progress", "batch"} and mark.startswith(f"{kind}-")


def job_suffix(transition: Transition) -> str:
    """Return suffix of the Job's name; a Campaign's name leaves no room for a whole mark."""
    return f"notify-{_hash(transition.mark)[:6]}"


def notice(
    identity: Identity, status: CampaignStatus, transition: Transition, now: datetime
) -> Notice:
    """Return the content of a notice."""
    passed = _condition(status, "Passed")
    over = transition.event in {"Finished", "GivenUp"}
    condition = passed if transition.event == "Finished" and passed else transition.since
    milestone = transition.event in {"Started", "Batch", "Progress"}  # the numbers are enough
    messages = [] if milestone else [condition.message]
    if transition.since.reason == "ProcessingFailed":
        messages.append(transition.since.message)
    started, ended = status.start_time, status.completion_time
    took = parse_time(ended) if ended else now
    return Notice(
        id=_hash(f"{identity.uid} {transition.mark}")[:32],
        event=transition.event,
        time=format_time(now),
        campaign=Named(
            namespace=identity.namespace,
            name=identity.name,
            uid=identity.uid,
            results=status.campaign,
            bucket=status.bucket,
        ),
        verdict=_verdict(passed) if over else None,
        runs=status.runs,
        failing=status.failing,
        search=status.search,
        seconds=(took - parse_time(started)).total_seconds() if started else None,
        reason=condition.reason,
        message="\n".join(messages),
    )


def _transition(status: CampaignStatus) -> Transition | None:
    """Return the transition in the conditions that is worth a notification, sent or not."""
    succeeded, stalled = _condition(status, "Succeeded"), _condition(status, "Stalled")
    results = _condition(status, "ResultsAvailable")
    attempt = status.attempt
    if succeeded is not None and succeeded.status == "False":
        return Transition("GivenUp", f"given-up-{attempt}", succeeded)
    if results is not None and results.status == "True":
        return Transition("Finished", f"finished-{attempt}-{status.finished_shards}", results)
    if stalled is None:
        return None
    if stalled.status == "True":
        return Transition("Stalled", f"stalled-{attempt}-{stalled.reason}", stalled, lasting=True)
    last = status.notified[-1] if status.notified else ""
    reconciling = _condition(status, "Reconciling")
    if last.startswith("stalled-") and reconciling is not None and reconciling.status == "True":
        cause = last.removeprefix("stalled-")
        return Transition("Recovered", f"recovered-{cause}", stalled, lasting=True)
    return None


def _next_milestone(
    status: CampaignStatus, receivers: Sequence[Notification], now: datetime
) -> tuple[Transition | None, float | None]:
    """Return the milestone of a running campaign, and the time until the next hour [s]."""
    going = _condition(status, "Reconciling")
    if status.start_time is None or going is None or status.state not in _GOING:
        return None, None
    started = parse_time(status.start_time)
    hours = (now - started) // HOUR
    batch = status.search.batch if status.search is not None else 0
    reached = [
        (Transition("Started", "started", going), True),
        (Transition("Batch", f"batch-{batch}", going), batch > 0),
        (Transition("Progress", f"progress-{hours}", going), hours > 0),
    ]
    for milestone, is_reached in reached:
        new = is_reached and milestone.mark not in status.notified
        if new and interested(milestone, receivers):
            return milestone, None
    if not _interested("Progress", receivers):
        return None, None
    return None, (started + (hours + 1) * HOUR - now).total_seconds()


def _verdict(passed: Condition | None) -> Literal["Passed", "Failed"]:
    return "Passed" if passed is not None and passed.status == "True" else "Failed"


def _condition(status: CampaignStatus, name: str) -> Condition | None:
    return next((c for c in status.conditions if c.type == name), None)


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()

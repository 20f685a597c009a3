"""Conditions of a campaign, and its state in one word. Pure functions."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from robovast.kubeapi.resources import CampaignSpec
from robovast.kubeapi.status import CampaignStatus, Condition, Runs, read_status
from robovast_operator.kube.conditions import Found, dated, is_true
from robovast_operator.kube.objects import Object
from robovast_operator.kube.store import JobState

Why = tuple[str, str]
"""Reason and message."""


@dataclass(frozen=True)
class Facts:
    """What conditions are made from."""

    generation: int
    now: str
    spec: CampaignSpec
    runs: Runs
    active: bool
    """Whether any Job of a shard is open."""
    over: bool
    """Whether nothing more is to be executed."""
    indexed: bool
    """Whether the results are complete in the bucket."""
    aborted: Why | None = None
    trouble: Why | None = None
    quota: Why | None = None
    helpless: bool = False
    """Whether it gets no quota until somebody helps."""
    unprocessed: Why | None = None
    """Why the results could not be worked up."""


def campaign_conditions(facts: Facts, old: Iterable[Condition]) -> list[Condition]:
    """All conditions of an accepted campaign."""
    found: list[Found] = [
        ("Accepted", "True", "Valid", "the document is in order"),
        _quota(facts),
        _reconciling(facts),
        _stalled(facts),
        _succeeded(facts),
        _passed(facts),
        _results(facts),
    ]
    return dated(found, facts.generation, facts.now, old)


def rejected_conditions(
    reason: str, message: str, generation: int, now: str, old: Iterable[Condition]
) -> list[Condition]:
    """All conditions of a campaign that cannot be executed as it is."""
    rest: list[Found] = [
        (name, "Unknown", "NotAccepted", "") for name in ("QuotaReserved", "Succeeded", "Passed")
    ]
    found: list[Found] = [
        ("Accepted", "False", reason, message),
        ("Reconciling", "False", "NotAccepted", ""),
        ("Stalled", "True", reason, message),
        ("ResultsAvailable", "False", "NotAccepted", ""),
        *rest,
    ]
    return dated(found, generation, now, old)


def composing_conditions(
    trouble: Why | None, generation: int, now: str, old: Iterable[Condition]
) -> list[Condition]:
    """All conditions of a campaign whose document is just being expanded."""
    reason, message = trouble or ("Composing", "the document is being expanded by a Job")
    names = ("Accepted", "QuotaReserved", "Succeeded", "Passed")
    unknown: list[Found] = [(name, "Unknown", "Composing", "") for name in names]
    found: list[Found] = [
        *unknown,
        ("Reconciling", "True", reason, message),
        ("Stalled", "True" if trouble else "False", reason, message if trouble else ""),
        ("ResultsAvailable", "False", "Composing", ""),
    ]
    return dated(found, generation, now, old)


def failing_conditions(
    why: Why, generation: int, now: str, old: Iterable[Condition]
) -> list[Condition]:
    """The conditions of a campaign with which nothing can be done: those before, and why."""
    before = list(old)
    kept: list[Found] = [
        (c.type, c.status, c.reason, c.message) for c in before if c.type != "Stalled"
    ]
    if not kept:
        kept = [("Accepted", "Unknown", *why), ("ResultsAvailable", "False", why[0], "")]
    return dated([*kept, ("Stalled", "True", *why)], generation, now, before)


def campaign_state(facts: Facts, conditions: Iterable[Condition]) -> str:
    """One word for people."""
    by_type = {condition.type: condition for condition in conditions}
    if by_type["Succeeded"].status == "False":
        return "Failed"
    if facts.over:
        return "Finished" if facts.indexed else "Finishing"
    if facts.spec.suspend:
        return "Suspended"
    if by_type["QuotaReserved"].status == "False":
        return "Queued"
    if not facts.active:
        return "Pending"
    if facts.runs.active:
        return "Running"
    if by_type["Stalled"].status == "True":
        return "Stalled"
    return "Running" if facts.runs.decided else "Pending"


def _quota(facts: Facts) -> Found:
    if facts.quota is not None:
        return ("QuotaReserved", "False", *facts.quota)
    if facts.spec.queue_name is None:
        return ("QuotaReserved", "True", "NoQueue", "spec.queueName names no queue")
    message = f"admitted by the queue {facts.spec.queue_name}"
    return ("QuotaReserved", "True", "Admitted", message)


def _reconciling(facts: Facts) -> Found:
    if facts.indexed:
        return ("Reconciling", "False", "Finished", "")
    if facts.over:
        return ("Reconciling", "True", "Finishing", "the results are being completed")
    if facts.spec.suspend:
        return ("Reconciling", "False", "Suspended", "spec.suspend is set")
    return ("Reconciling", "True", "Running", f"{facts.runs.decided} of {facts.runs.total} runs")


def _stalled(facts: Facts) -> Found:
    cause = facts.aborted or facts.trouble or (facts.quota if facts.helpless else None)
    if cause is not None and not (facts.indexed and facts.aborted is None):
        return ("Stalled", "True", *cause)
    return ("Stalled", "False", "Progressing", "")


def _succeeded(facts: Facts) -> Found:
    if facts.aborted is not None:
        return ("Succeeded", "False", *facts.aborted)
    if facts.over:
        return ("Succeeded", "True", "Finished", f"all {facts.runs.total} runs have ended")
    return ("Succeeded", "Unknown", "Running", "")


def _passed(facts: Facts) -> Found:
    runs, least = facts.runs, facts.spec.acceptance.min_pass_ratio
    bad = runs.failed + runs.errored
    needed = float(least) * runs.total
    told = f"{runs.passed} of {runs.total} runs passed; needed are {least} of all"
    if runs.total and runs.total - bad < needed - 1e-9:
        return ("Passed", "False", "TooManyBadRuns", told)
    if facts.aborted is not None:
        return ("Passed", "False", facts.aborted[0], facts.aborted[1])
    if facts.over and facts.indexed:
        return ("Passed", "True", "Accepted", told)
    return ("Passed", "Unknown", "Running", "")


def _results(facts: Facts) -> Found:
    if facts.indexed and facts.unprocessed is not None:
        message = f"the results are complete, but not worked up: {facts.unprocessed[1]}"
        return ("ResultsAvailable", "True", "ProcessingFailed", message)
    if facts.indexed:
        return ("ResultsAvailable", "True", "Indexed", "the bucket is complete")
    return ("ResultsAvailable", "False", "Running", "")


def is_news(old: CampaignStatus, new: CampaignStatus) -> bool:
    """Whether a change of status is told at once: numbers can wait, facts cannot."""

    def facts(status: CampaignStatus) -> list[tuple[str, str, str]]:
        return [(c.type, c.status, c.reason) for c in status.conditions]

    def shards(status: CampaignStatus) -> list[tuple[str, str]]:
        return [(shard.job, shard.state) for shard in status.shards]

    def all_done(status: CampaignStatus) -> bool:
        return status.runs.decided == status.runs.total

    return (
        facts(old) != facts(new)
        or shards(old) != shards(new)
        or all_done(old) != all_done(new)
        or (old.attempt, old.observed_generation) != (new.attempt, new.observed_generation)
        or old.notified != new.notified
    )


def is_settled(
    obj: Object, jobs: Mapping[str, JobState], configurations: Collection[Object]
) -> bool:
    """Whether a campaign is finished for good: it costs nothing more."""
    status = read_status(CampaignStatus, obj.get("status"))
    spec = obj.get("spec") or {}
    expires = spec.get("ttlSecondsAfterFinished") is not None and bool(jobs)
    there = {"", *(item["metadata"]["uid"] for item in configurations)}
    return (
        status.observed_generation == obj["metadata"].get("generation")
        and is_true(status, "ResultsAvailable")
        and not expires
        and all(job.configuration in there for job in jobs.values())
        and all(
            (item.get("status") or {}).get("observedGeneration")
            == item["metadata"].get("generation")
            for item in configurations
        )
    )

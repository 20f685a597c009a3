"""Conditions of a campaign, and its state in one word. Pure functions."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from robovast.kubeapi.status import CampaignStatus, Condition, Runs, SearchStatus, read_status
from robovast_operator.kube.conditions import Found, dated, is_true
from robovast_operator.kube.objects import Object
from robovast_operator.kube.sentences import clause
from robovast_operator.kube.store import JobState
from robovast_operator.kube.times import format_time
from robovast_operator.pods.observations import Trouble
from robovast_operator.snapshot import Snapshot


def campaign_conditions(snapshot: Snapshot, runs: Runs) -> list[Condition]:
    """Return all conditions of an accepted campaign.

    Args:
        snapshot: of the campaign.
        runs: the numbers of its runs.
    """
    found: list[Found] = [
        ("Accepted", "True", "Valid", "The .vast file is valid."),
        _quota(snapshot),
        _reconciling(snapshot, runs),
        _stalled(snapshot),
        _succeeded(snapshot, runs),
        _passed(snapshot, runs),
        _results(snapshot),
    ]
    moment = format_time(snapshot.now)
    return dated(found, snapshot.generation, moment, snapshot.status.conditions)


def rejected_conditions(reason: str, message: str, before: Iterable[Condition] = ()) -> list[Found]:
    """Return all conditions of a rejected campaign.

    Args:
        reason: CamelCase reason.
        message: for people.
        before: conditions of the runs that were planned earlier and continue.
    """
    found: list[Found] = [
        ("Accepted", "False", reason, message),
        ("Stalled", "True", reason, message),
    ]
    kept: list[Found] = [
        (c.type, c.status, c.reason, c.message)
        for c in before
        if c.type not in {"Accepted", "Stalled"}
    ]
    unknown = ("QuotaReserved", "Succeeded", "Passed")
    rest: list[Found] = [
        *((name, "False", "NotAccepted", "") for name in ("Reconciling", "ResultsAvailable")),
        *((name, "Unknown", "NotAccepted", "") for name in unknown),
    ]
    return [*found, *(kept or rest)]


def composing_conditions(trouble: Trouble | None) -> list[Found]:
    """Return all conditions of a campaign whose document is just being expanded."""
    found = trouble or Trouble("Expanding", "A Job expands the .vast file.")
    names = ("Accepted", "QuotaReserved", "Succeeded", "Passed")
    unknown: list[Found] = [(name, "Unknown", "Expanding", "") for name in names]
    return [
        *unknown,
        ("Reconciling", "True", found.reason, found.message),
        (
            "Stalled",
            "True" if trouble else "False",
            found.reason,
            trouble.message if trouble else "",
        ),
        ("ResultsAvailable", "False", "Expanding", ""),
    ]


def failing_conditions(trouble: Trouble, before: Iterable[Condition]) -> list[Found]:
    """Return the conditions of a campaign that cannot be reconciled: the previous ones, and why."""
    why = (trouble.reason, trouble.message)
    kept: list[Found] = [
        (c.type, c.status, c.reason, c.message) for c in before if c.type != "Stalled"
    ]
    if not kept:
        kept = [("Accepted", "Unknown", *why), ("ResultsAvailable", "False", trouble.reason, "")]
    return [*kept, ("Stalled", "True", *why)]


SUSPENDED = "The campaign is suspended. To resume the campaign, set spec.suspend to false."


def campaign_state(
    snapshot: Snapshot, runs: Runs, conditions: Iterable[Condition], *, active: bool
) -> str:
    """Return the state of a campaign as one word.

    Args:
        snapshot: of the campaign.
        runs: the numbers of its runs.
        conditions: of the campaign.
        active: whether any Job of a shard is open.
    """
    by_type = {condition.type: condition for condition in conditions}
    if by_type["Succeeded"].status == "False":
        return "Failed"
    if snapshot.over:
        return "Finished" if snapshot.indexed else "Finishing"
    if snapshot.accepted.spec.suspend:
        return "Suspended"
    if by_type["QuotaReserved"].status == "False":
        return "Queued"
    if snapshot.idle:
        return "Proposing"
    if not active:
        return "Pending"
    if runs.active:
        return "Running"
    if by_type["Stalled"].status == "True":
        return "Stalled"
    return "Running" if runs.decided else "Pending"


def _quota(snapshot: Snapshot) -> Found:
    held, queue = snapshot.held, snapshot.accepted.spec.queue_name
    if held is not None:
        return ("QuotaReserved", "False", held.reason, held.message)
    if queue is None:
        return ("QuotaReserved", "True", "NoQueue", "No queue is used.")
    return ("QuotaReserved", "True", "Admitted", f"Queue {queue} has admitted the campaign.")


def _reconciling(snapshot: Snapshot, runs: Runs) -> Found:
    if snapshot.indexed:
        return ("Reconciling", "False", "Finished", "")
    if snapshot.over:
        return ("Reconciling", "True", "Finishing", "The operator completes the results.")
    if snapshot.accepted.spec.suspend:
        return ("Reconciling", "False", "Suspended", SUSPENDED)
    if snapshot.idle:
        return ("Reconciling", "True", "Proposing", "A Job proposes the next runs of the search.")
    return ("Reconciling", "True", "Running", f"{runs.decided} of {runs.needed} runs finished.")


def _stalled(snapshot: Snapshot) -> Found:
    held = snapshot.held if snapshot.held is not None and snapshot.held.helpless else None
    cause = snapshot.given_up or snapshot.trouble or held
    if cause is not None and not (snapshot.indexed and snapshot.given_up is None):
        return ("Stalled", "True", cause.reason, cause.message)
    return ("Stalled", "False", "Progressing", "")


def _succeeded(snapshot: Snapshot, runs: Runs) -> Found:
    if snapshot.given_up is not None:
        return ("Succeeded", "False", snapshot.given_up.reason, snapshot.given_up.message)
    if snapshot.over:
        search = snapshot.search.status
        why = f" The search ended: {clause(search.stop_reason)}." if search is not None else ""
        skipped = f"; {runs.not_needed} runs were not needed" if runs.not_needed else ""
        message = f"All {runs.needed} runs finished{skipped}.{why}"
        return ("Succeeded", "True", "Finished", message)
    return ("Succeeded", "Unknown", "Running", "")


def _passed(snapshot: Snapshot, runs: Runs) -> Found:
    if snapshot.search.status is not None:
        return _found(snapshot, snapshot.search.status)
    least = snapshot.accepted.spec.acceptance.min_pass_ratio
    bad = runs.failed + runs.errored
    needed = float(least) * runs.needed
    required = "all" if float(least) == 1 else f"a fraction of {least}"
    message = f"{runs.passed} of {runs.needed} runs passed; spec.acceptance requires {required}."
    if runs.needed and runs.needed - bad < needed - 1e-9:
        message += " List the unsuccessful runs with `vast exec cluster runs --failed`."
        return ("Passed", "False", "TooManyUnsuccessfulRuns", message)
    if snapshot.given_up is not None:
        return ("Passed", "False", snapshot.given_up.reason, snapshot.given_up.message)
    if snapshot.over and snapshot.indexed:
        return ("Passed", "True", "EnoughRunsPassed", message)
    return ("Passed", "Unknown", "Running", "")


def _found(snapshot: Snapshot, search: SearchStatus) -> Found:
    """Return the condition Passed of a search, which passes if parameter sets have scores."""
    if snapshot.given_up is not None:
        return ("Passed", "False", snapshot.given_up.reason, snapshot.given_up.message)
    if not (snapshot.over and snapshot.indexed):
        return ("Passed", "Unknown", "Running", "")
    message = f"The search ended: {clause(search.stop_reason)}."
    if search.stop == "errors" or not search.evaluated:
        none = "No parameter set could be scored. Check `search.objective` in the .vast file."
        return ("Passed", "False", "NotScored", message if search.evaluated else none)
    return ("Passed", "True", "SearchFinished", message)


def _results(snapshot: Snapshot) -> Found:
    unprocessed = snapshot.pods.failures.get(snapshot.process_name)
    if snapshot.indexed and unprocessed is not None:
        message = f"The results are stored, but postprocessing failed. {unprocessed.message}"
        return ("ResultsAvailable", "True", "ProcessingFailed", message)
    if snapshot.indexed:
        return ("ResultsAvailable", "True", "Indexed", "The bucket contains all results.")
    return ("ResultsAvailable", "False", "Running", "")


def is_news(old: CampaignStatus, new: CampaignStatus) -> bool:
    """Return whether a changed status is written at once: numbers can wait, conditions cannot."""

    def facts(status: CampaignStatus) -> list[tuple[str, str, str]]:
        return [(c.type, c.status, c.reason) for c in status.conditions]

    def shards(status: CampaignStatus) -> list[tuple[str, str]]:
        return [(shard.job, shard.state) for shard in status.shards]

    def all_done(status: CampaignStatus) -> bool:
        return status.runs.decided == status.runs.needed

    return (
        facts(old) != facts(new)
        or shards(old) != shards(new)
        or all_done(old) != all_done(new)
        or (old.attempt, old.observed_generation) != (new.attempt, new.observed_generation)
        or (old.notified, old.shared) != (new.notified, new.shared)
    )


def is_settled(
    obj: Object, jobs: Mapping[str, JobState], configurations: Collection[Object]
) -> bool:
    """Return whether a campaign is finished, so that no work is left."""
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

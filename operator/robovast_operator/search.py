"""The progress of a campaign's search, as its propose Jobs have reported it. Pure functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from robovast.kubeapi.pod_contract.messages import Proposed
from robovast.kubeapi.status import SearchStatus
from robovast_operator.kube.store import JobState
from robovast_operator.planning.campaign import Accepted, Revision
from robovast_operator.planning.proposals import grown, no_plan, search_status
from robovast_operator.pods.job_attempts import Tries


@dataclass(frozen=True)
class SearchState:
    """The search of a campaign; most of it is None or empty if the campaign is no search."""

    accepted: Accepted
    revisions: Sequence[Revision]
    stored: SearchStatus | None
    """Its progress in the campaign's status."""
    jobs: Mapping[str, JobState]
    """The campaign's Jobs."""
    proposals: Mapping[str, Proposed]
    """What pods of propose Jobs have reported, by Job."""
    variant_limit: int
    """Most variants of a document."""

    @cached_property
    def status(self) -> SearchStatus | None:
        """Return the progress; None if the campaign is no search.

        A reason to stop is valid for one plan only: with a newer plan, the search continues.
        """
        if not self.accepted.is_search:
            return None
        newest = self.revisions[-1]
        if self.proposed is not None:
            return search_status(self.proposed, newest.config_map)
        stored = self.stored or SearchStatus()
        if proposed := self._proposed(self._proposing(newest.number)):
            stored = search_status(proposed, "")
        if stored.plan == newest.config_map:
            return stored
        return stored.model_copy(update={"plan": newest.config_map, "stop": "", "stop_reason": ""})

    @cached_property
    def goes_on(self) -> bool:
        """Return whether the search may propose further runs."""
        return self.status is not None and not self.status.stop

    @cached_property
    def proposing(self) -> Tries:
        """Return the Jobs that propose the next runs; each plan needs further ones."""
        return self._proposing(self.revisions[-1].number + 1)

    @cached_property
    def proposed(self) -> Proposed | None:
        """Return the message of the current propose Jobs; None without a message."""
        return self._proposed(self.proposing)

    @cached_property
    def growth(self) -> Revision | str | None:
        """Return the plan with the proposed runs, or the error message."""
        if self.proposed is None or self.proposed.stop:
            return None
        name = self.revisions[-1].next_name(self.accepted.identity)
        try:
            return grown(self.accepted, self.revisions, self.proposed, name, self.variant_limit)
        except ValueError as error:
            return no_plan(error)

    @cached_property
    def past_jobs(self) -> list[JobState]:
        """Return propose Jobs that are no longer needed."""
        last = self.proposing.last
        return [job for job in self.jobs.values() if job.role == "propose" and job is not last]

    def _proposing(self, plan: int) -> Tries:
        return Tries.of(self.jobs.values(), self.accepted.identity.child(f"propose-{plan}"))

    def _proposed(self, tries: Tries) -> Proposed | None:
        found = self.proposals
        return next((found[job.name] for job in tries.jobs if job.name in found), None)

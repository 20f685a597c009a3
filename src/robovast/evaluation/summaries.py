"""Summaries of runs and campaigns for lists."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Literal

from robovast.base.sequential import Decision
from robovast.campaign.decisions import CampaignTest, decide
from robovast.campaign.verdict import Verdict

LISTED = (
    "run",
    "verdict",
    "reason",
    "started_at",
    "duration",
    "seed",
    "reused_from",
    "job",
    "host",
)
"""Columns of a run that lists show, in the order of `RunSummary.of`."""
_LONGEST_REASON = 500
"""Longest reason in lists [characters]; the run's page shows all of it."""
_LONGEST_NAME = 100
"""Longest name of a job or computer in lists [characters]."""
_LARGEST_NUMBER = 1e18
"""Largest plausible time [s]."""


@dataclass(frozen=True, slots=True)
class RunSummary:
    """One run."""

    number: int
    verdict: Verdict
    reason: str
    started_at: float | None
    """[s since the epoch]"""
    duration: float | None
    """[s]"""
    seed: int | None = None
    """None in campaigns of RoboVAST 1.x."""
    reused: bool = False
    """Whether another campaign executed it."""
    job: str = ""
    """What executed it; empty if its record does not say."""
    host: str = ""
    """The computer that executed it; empty if its record does not say."""

    @classmethod
    def of(
        cls,
        number: int,
        verdict: Verdict,
        reason: str | None,
        started_at: str | float | None,
        duration: float | None,
        seed: int | None,
        reused_from: str | None,
        job: str | None,
        host: str | None,
    ) -> RunSummary:
        """The summary of a run from its columns in `LISTED`, from a record or a table.

        Texts that are equal in many runs are stored once.
        """
        is_plausible = duration is not None and abs(duration) < _LARGEST_NUMBER
        return cls(
            number,
            verdict,
            sys.intern((reason or "")[:_LONGEST_REASON]),
            seconds(started_at) if isinstance(started_at, str) else started_at,
            duration if is_plausible else None,
            seed,
            bool(reused_from),
            sys.intern((job or "")[:_LONGEST_NAME]),
            sys.intern((host or "")[:_LONGEST_NAME]),
        )


def seconds(value: Any) -> float | None:
    """Convert an ISO 8601 time to seconds since the epoch; None if it is invalid."""
    try:
        return datetime.fromisoformat(str(value)).timestamp()
    except (ValueError, OverflowError):
        return None


@dataclass(frozen=True, slots=True)
class VariantRuns:
    """A variant and its stored runs, sorted by number."""

    name: str
    entry: str
    parameters: Mapping[str, Any]
    runs: tuple[RunSummary, ...]
    stated: Mapping[str, Any] = field(default_factory=dict)
    """Values of its factors, if its variation types state other ones than the parameters."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Of the stated factors that have one."""

    @property
    def factors(self) -> Mapping[str, Any]:
        """What was varied: stated factors, otherwise the parameters."""
        return self.stated or self.parameters


@dataclass(frozen=True, slots=True)
class ActiveJob:
    """A job in progress."""

    name: str
    log: str | None
    """Path of its log relative to the results folder; None before it has one."""


@dataclass(frozen=True)
class CampaignSummary:
    """One campaign."""

    name: str
    state: Literal["running", "finished", "incomplete"]
    """`incomplete`: not running, and runs are missing."""
    planned: int
    """Number of planned runs."""
    counts: Mapping[Verdict, int]
    """Stored runs by verdict."""
    variants: int
    started_at: float | None
    """[s since the epoch]"""
    duration: float | None
    """From its start to the end of its last run; while it is running, until now [s]."""
    execution: Mapping[str, Any]
    """Content of execution.yaml."""
    version: int
    """Increases with every change."""
    reused: int = 0
    """Stored runs that other campaigns executed."""
    test: CampaignTest | None = None
    """What ends the runs of a configuration, if their number is not fixed."""
    is_search: bool = False
    """Whether a search chose what was run."""


def decision_of(test: CampaignTest, variant: VariantRuns) -> Decision:
    """What a test says of a configuration."""
    return decide(test.of(variant.name), {run.number: run.verdict for run in variant.runs})

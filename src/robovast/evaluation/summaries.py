"""Summaries of runs and campaigns for lists."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from robovast.base.sequential import Decision
from robovast.campaign.decisions import CampaignTest, decide
from robovast.campaign.verdict import Verdict


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
    state: str
    """`running`, `finished`, or `incomplete`: not running, and runs are missing."""
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

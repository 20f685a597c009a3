"""What a document expands to that only a Job may expand."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Composition:
    """What a document expands to, as its compose Job says."""

    counts: list[int]
    """Variants by configuration entry."""
    breaks: str
    """`PlanSpec.breaks`."""
    digest: str | None
    """`CampaignPlan.composed`; None when the Job was of an older version."""

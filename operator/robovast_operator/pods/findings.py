"""What was found in pods and in their last words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from robovast.base.ranges import Span
from robovast.kubeapi.status import Runs
from robovast_operator.pods.verdicts import Report


@dataclass(frozen=True)
class Trouble:
    """Why nothing moves, or why a campaign cannot go on."""

    reason: str
    """One word."""
    message: str
    final: bool = False
    """Whether the campaign is given up."""
    repeated: bool = False
    """Whether pods that start die of it, too, one after the other."""


@dataclass(frozen=True)
class Final:
    """What the finish Job found in the bucket."""

    runs: Runs
    failed: Sequence[Span]
    errored: Sequence[Span]
    truncated: bool
    """Whether ids are missing in these two."""
    failing: tuple[str, ...]
    list: str = ""
    """Name of the list of all bad runs in the bucket; empty when none is bad, or none is stored."""
    sizes: str = ""
    """Sizes of the groups in which they are executed once more."""


@dataclass(frozen=True)
class PodFindings:
    """What the pods of a campaign tell at one moment."""

    reports: Mapping[str, Mapping[int, Report]] = field(default_factory=dict)
    """By Job, what pods of its failed indexes said."""
    finals: Mapping[str, Final] = field(default_factory=dict)
    """By finish Job, what it found."""
    failures: Mapping[str, Trouble] = field(default_factory=dict)
    """By Job that failed as a whole, why."""
    stuck: frozenset[str] = frozenset()
    """Jobs that hold pods which are to go; made anew they go on."""
    trouble: Trouble | None = None
    again: float | None = None
    """When to look again [s]; None when events will tell."""

"""What pods and their termination messages report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from robovast.base.ranges import Span
from robovast.kubeapi.pod_contract.messages import Proposed
from robovast.kubeapi.status import Runs
from robovast.model.packing import Pace
from robovast_operator.pods.verdicts import Report


@dataclass(frozen=True)
class Trouble:
    """Why a campaign makes no progress, or cannot continue."""

    reason: str
    """CamelCase reason of the condition."""
    message: str
    final: bool = False
    """Whether it aborts the campaign."""
    deadly: bool = False
    """Whether pods have failed of it: only a success shows that it is over, not another pod."""


@dataclass(frozen=True)
class Mishap:
    """A run that did not pass, or a pod that ended without a word, for people."""

    reason: str
    """CamelCase reason of its Event."""
    about: str
    """The run, or the pod."""
    message: str


MISHAPS = 3
"""Maximum number of mishaps with separate Events."""


@dataclass(frozen=True)
class Final:
    """What the finish Job found in the bucket."""

    runs: Runs
    failed: Sequence[Span]
    errored: Sequence[Span]
    truncated: bool
    """Whether ids are missing in `failed` or `errored`."""
    failing: tuple[str, ...]
    list: str = ""
    """Name of the list of all bad runs in the bucket; empty if there is none."""
    sizes: str = ""
    """Sizes of the groups in which they are repeated."""
    decisions: str = ""
    """What is decided about configurations, for people."""


@dataclass(frozen=True)
class PodFindings:
    """What the pods of a campaign report at one moment."""

    reports: Mapping[str, Mapping[int, Report]] = field(default_factory=dict)
    """By Job: the reports of the pods of its failed indexes."""
    finals: Mapping[str, Final] = field(default_factory=dict)
    """By finish Job: what it found."""
    proposals: Mapping[str, Proposed] = field(default_factory=dict)
    """By propose Job: its message."""
    pace: Pace | None = None
    """What starts and runs have taken, where packs are measured."""
    mishaps: Sequence[Mishap] = ()
    """The first of the campaign."""
    failures: Mapping[str, Trouble] = field(default_factory=dict)
    """By Job that failed as a whole: the cause."""
    stuck: frozenset[str] = frozenset()
    """Jobs that hold back the deletion of their pods, and must be replaced."""
    trouble: Trouble | None = None
    again: float | None = None
    """When to reconcile again [s]; None if watch events suffice."""

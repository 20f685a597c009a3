"""Failures by cause: reasons that differ only in numbers have one cause. Pure functions."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Generic, TypeVar

from robovast.campaign.reasons import plain
from robovast.campaign.verdict import Verdict

Run = TypeVar("Run")

NO_REASON = "no reason is known"

_CODE = r"(?<!code )(?<!status )(?<!failed with )(?<!errno )(?<!HTTP )"
"""Words before numbers that tell causes apart."""
_NUMBER = r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"
_VARYING = re.compile(
    r"([0-9a-f]{8}-(?:[0-9a-f]{4}-){3}[0-9a-f]{12}|\b0x[0-9a-f]+\b"
    rf"|{_CODE}(?<!\d)(?<!\d\.){_NUMBER}(?:[\s,;:/_x-]*{_NUMBER})*)",
    re.IGNORECASE,
)
"""What differs between reasons of one cause: identifiers, and numbers in a row."""


@dataclass(frozen=True)
class FailureGroup(Generic[Run]):
    """Runs that did not pass for one cause."""

    cause: str
    """Their reason; `…` stands for the numbers in which they differ."""
    verdicts: tuple[Verdict, ...]
    """Their verdicts, which usually are one."""
    runs: tuple[Run, ...]
    """In the order in which they were given."""


def failure_groups(runs: Iterable[tuple[Run, Verdict, str]]) -> list[FailureGroup[Run]]:
    """Group the runs that did not pass, given with verdict and reason; the largest groups first."""
    bad = [(run, verdict, reason) for run, verdict, reason in runs if verdict != Verdict.PASSED]
    cause_of = causes(reason for _, _, reason in bad)
    members: dict[str, list[tuple[Run, Verdict]]] = {}
    for run, verdict, reason in bad:
        members.setdefault(cause_of[reason], []).append((run, verdict))
    groups = [
        FailureGroup(
            cause,
            tuple(verdict for verdict in Verdict if verdict in {found for _, found in group}),
            tuple(run for run, _ in group),
        )
        for cause, group in members.items()
    ]
    return sorted(groups, key=lambda group: -len(group.runs))


def causes(reasons: Iterable[str]) -> dict[str, str]:
    """The cause of each reason."""
    parts = {reason: _parts(reason) for reason in reasons}
    members: dict[str, list[list[str]]] = {}
    for reason, found in parts.items():
        members.setdefault(cause_key(reason), []).append(found)
    labels = {key: _label(group) for key, group in members.items()}
    return {reason: labels[cause_key(reason)] for reason in parts}


def cause_key(reason: str) -> str:
    """Equal for reasons of one cause."""
    return "#".join(_parts(reason)[::2])


@lru_cache(maxsize=4096)
def _parts(reason: str) -> list[str]:
    """A reason's constant and varying parts, in turns."""
    return _VARYING.split(plain(reason) or NO_REASON)


def _label(members: list[list[str]]) -> str:
    return "".join(
        alike[0] if len(set(alike)) == 1 else "…" for alike in zip(*members, strict=True)
    )

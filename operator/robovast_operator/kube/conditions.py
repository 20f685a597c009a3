"""Conditions of Kubernetes objects. Pure functions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

from robovast.base.errors import without_userinfo
from robovast.kubeapi.status import CampaignStatus, Condition

Truth = Literal["True", "False", "Unknown"]


Found = tuple[str, Truth, str, str]
"""Type, status, reason and message of a condition."""


def is_true(status: CampaignStatus, name: str) -> bool:
    """Return whether a condition holds."""
    return any(c.type == name and c.status == "True" for c in status.conditions)


def dated(
    found: Sequence[Found], generation: int, now: str, old: Iterable[Condition]
) -> list[Condition]:
    """Return conditions with the time since when their status holds."""
    before = {condition.type: condition for condition in old}
    made = []
    for name, status, reason, message in found:
        previous = before.get(name)
        since = previous.last_transition_time if previous and previous.status == status else now
        made.append(
            Condition(
                type=name,
                status=status,
                reason=reason,
                message=without_userinfo(message)[:4000],
                observed_generation=generation,
                last_transition_time=since or now,
            )
        )
    return made

"""Names of everything that a campaign leaves in a cluster."""

from __future__ import annotations

CAMPAIGN_NAME_LIMIT = 40
"""Longest name of a Campaign: its Jobs and their pods add to it, within 63 characters."""

CAMPAIGN_NAME_RULE = (
    "the name of a Campaign has at most 40 characters and no dots, because the names of its pods "
    "begin with it"
)

CREDENTIALS_SECRET = "robovast-storage"  # noqa: S105 - the name of a Secret, not its content
"""Secret with `accessKey` and `secretKey` that pods mount when a Campaign names none."""


def child_name(campaign: str, uid: str, suffix: str | int) -> str:
    """Name of an object of a Campaign; two Campaigns of one name, one after the other, differ."""
    return f"{campaign}-{uid[:4]}-{suffix}"

"""Names of everything that a campaign leaves in a cluster and in S3."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from datetime import datetime

from robovast.common.execution import campaign_folder_name

CAMPAIGN_NAME_LIMIT = 40
"""Longest name of a Campaign: its Jobs and their pods add to it, within 63 characters."""

BUCKET_LIMIT = 63
UID_DIGITS = 10

CREDENTIALS_SECRET = "robovast-storage"  # noqa: S105 - the name of a Secret, not its content
"""Secret with `accessKey` and `secretKey` that pods mount when a Campaign names none."""

BUNDLES_BUCKET = "robovast-bundles"


def campaign_id(name: str, created: datetime) -> str:
    """Name of a campaign's results folder.

    Args:
        name: `metadata.name` of the document, else of the Campaign.
        created: creation time of the Campaign (UTC).
    """
    return campaign_folder_name(name, created)


def bucket_name(campaign: str, prefix: str = "", uid: str = "") -> str:
    """A campaign's bucket: lower case, letters, digits and `-`, 3 to 63 characters.

    What is too long is cut and made distinct again by a hash.

    Args:
        campaign: name of the results folder.
        prefix: begins the name.
        uid: of the Campaign, whose first digits end the name: two Campaigns may have one name and
            be of one second. Buckets of older versions have none.
    """
    wanted = f"{prefix}{campaign}"
    mark = f"-{uid_digits(uid)}" if uid else ""
    limit = BUCKET_LIMIT - len(mark)
    name = re.sub(r"[^a-z0-9]+", "-", wanted.lower()).strip("-")
    if len(name) > limit:
        cut = hashlib.sha256(wanted.encode()).hexdigest()[:8]
        name = f"{name[: limit - 9].rstrip('-')}-{cut}"
    return f"{name}{mark}".ljust(3, "0")


def uid_digits(uid: str) -> str:
    """As much of a uid as tells campaigns of one name and second apart."""
    return uid.replace("-", "").lower()[:UID_DIGITS]


def buckets_of(campaign: str, buckets: Iterable[str]) -> list[str]:
    """The buckets that can be a campaign's, by the name of its results folder or of its bucket."""
    stem = bucket_name(campaign, uid="0" * UID_DIGITS)[:-UID_DIGITS]
    pattern = re.compile(re.escape(stem) + f"[0-9a-f]{{{UID_DIGITS}}}")
    return [
        name
        for name in buckets
        if name in {campaign, bucket_name(campaign)} or pattern.fullmatch(name)
    ]


def child_name(campaign: str, uid: str, suffix: str | int) -> str:
    """Name of an object of a Campaign; two Campaigns of one name, one after the other, differ."""
    return f"{campaign}-{uid[:4]}-{suffix}"

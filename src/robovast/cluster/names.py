"""Names of everything that a campaign leaves in a cluster and in S3."""

from __future__ import annotations

import hashlib
import re
from datetime import datetime

from robovast.common.execution import campaign_folder_name

CAMPAIGN_NAME_LIMIT = 40
"""Longest name of a Campaign: its Jobs and their pods add to it, within 63 characters."""

BUCKET_LIMIT = 63

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


def bucket_name(campaign: str, prefix: str = "") -> str:
    """A campaign's bucket: lower case, letters, digits and `-`, 3 to 63 characters.

    What is too long is cut and made distinct again by a hash.
    """
    wanted = f"{prefix}{campaign}"
    name = re.sub(r"[^a-z0-9]+", "-", wanted.lower()).strip("-")
    if len(name) <= BUCKET_LIMIT:
        return name.ljust(3, "0")
    mark = hashlib.sha256(wanted.encode()).hexdigest()[:8]
    return f"{name[: BUCKET_LIMIT - 9].rstrip('-')}-{mark}"


def child_name(campaign: str, uid: str, suffix: str | int) -> str:
    """Name of an object of a Campaign; two Campaigns of one name, one after the other, differ."""
    return f"{campaign}-{uid[:4]}-{suffix}"

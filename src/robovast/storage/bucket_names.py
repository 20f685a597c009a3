"""Names of campaigns and their buckets."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from datetime import datetime

from robovast.model.naming import campaign_folder_name

BUCKET_LIMIT = 63
UID_DIGITS = 10

BUNDLES_BUCKET = "robovast-bundles"
REUSE_BUCKET = "robovast-reuse"
"""Where runs are stored, by key (docs/contributing/agent.md, "Reused runs")."""


def campaign_id(metadata: object, name: str, created: datetime) -> str:
    """Name of a campaign's results folder.

    Args:
        metadata: `metadata` of the .vast file, whose `name` is used.
        name: of the Campaign, used if the .vast file has no name.
        created: creation time of the Campaign (UTC).
    """
    given = metadata.get("name") if isinstance(metadata, Mapping) else None
    return campaign_folder_name(str(given or name), created)


def bucket_name(campaign: str, prefix: str = "", uid: str = "") -> str:
    """Name of a campaign's bucket: 3 to 63 lower-case letters, digits and `-`.

    Longer names are shortened and made unique by a hash.

    Args:
        campaign: name of the results folder.
        prefix: prefix of the bucket's name.
        uid: uid of the Campaign; its first digits are appended, since two Campaigns may have the
            same name and second. Buckets of RoboVAST 1.x have none.
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
    """Enough digits of a uid to distinguish campaigns of the same name and second."""
    return uid.replace("-", "").lower()[:UID_DIGITS]


def buckets_of(campaign: str, buckets: Iterable[str]) -> list[str]:
    """Buckets that may belong to a campaign, given by the name of its results folder or bucket."""
    stem = bucket_name(campaign, uid="0" * UID_DIGITS)[:-UID_DIGITS]
    pattern = re.compile(re.escape(stem) + f"[0-9a-f]{{{UID_DIGITS}}}")
    return [
        name
        for name in buckets
        if name in {campaign, bucket_name(campaign)} or pattern.fullmatch(name)
    ]

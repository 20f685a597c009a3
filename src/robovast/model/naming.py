"""How campaign folders are named."""

from __future__ import annotations

import re
from datetime import datetime
from pathlib import Path

_CAMPAIGN = re.compile(r"^(?P<name>.+)-(?P<timestamp>\d{4}-\d{2}-\d{2}-\d{6}(?:\d{2})?)$")


def campaign_prefix(name: str, keep: str = ".-") -> str:
    """A campaign's name as its folder begins: what is neither letter, digit nor kept becomes `-`.

    `run.sh` keeps `_`; elsewhere the name is one of Kubernetes, too.
    """
    return re.sub(f"[^A-Za-z0-9{re.escape(keep)}]+", "-", name).strip("-.") or "campaign"


def campaign_folder_name(name: str, started: datetime) -> str:
    """`<name>-YYYY-MM-DD-HHMMSS`."""
    return f"{campaign_prefix(name)}-{started:%Y-%m-%d-%H%M%S}"


def is_campaign_dir(path: str | Path) -> bool:
    """True when a folder is named as campaigns are; `run.sh` adds hundredths of the second."""
    return _CAMPAIGN.match(Path(path).name) is not None


def get_campaign(name: str = "campaign") -> str:
    """Name of a new campaign's folder."""
    return campaign_folder_name(name, datetime.now().astimezone())


def get_campaign_timestamp(name: str | Path) -> str | None:
    """The `YYYY-MM-DD-HHMMSS[cc]` of a campaign folder's name, or None."""
    match = _CAMPAIGN.match(Path(name).name)
    return match["timestamp"] if match else None


def campaign_time(name: str | Path) -> datetime | None:
    """When a campaign was started, to the second, as the name of its folder says."""
    timestamp = get_campaign_timestamp(name) or ""
    try:
        return datetime.strptime(timestamp[:17], "%Y-%m-%d-%H%M%S")
    except ValueError:
        return None

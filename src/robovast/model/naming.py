"""Names of campaign folders, and how to recognize them."""

from __future__ import annotations

import os
import re
from datetime import datetime
from pathlib import Path

CONFIG = "_config"
"""Folder of inputs, in a campaign's folder and in each variant's."""
CONFIG_MOUNT = "/config/"
"""Path of the .vast file's folder within a container."""
EXECUTION = "_execution"
"""Folder of records of the execution."""
TRANSIENT = "_transient"
"""Folder of generated intermediate files."""
TEST_RESULT = "test.xml"
"""A run's JUnit report."""
CAMPAIGN_STORE = "campaign.db"
METADATA = "metadata.yaml"
GRAPH = "metadata.prov.json"
OWN_FILES = frozenset({CAMPAIGN_STORE, METADATA, GRAPH})
"""Files beside the variants' folders."""

_LONGEST = 200
"""Most characters of a folder's name before the date; 255 is what file systems have room for, and
some of it other words take while a folder is being made."""
_RUN = re.compile("0|[1-9][0-9]{0,8}")
_CAMPAIGN = re.compile(r"^(?P<name>.+)-(?P<timestamp>\d{4}-\d{2}-\d{2}-\d{6}(?:\d{2})?)$")


def campaign_prefix(name: str, keep: str = ".-") -> str:
    """A campaign's name as folder prefix: letters, digits and `keep` stay, others become `-`, and
    it ends where file systems would refuse a name with a date behind it.

    `run.sh` keeps `_`; elsewhere the name must also be valid in Kubernetes.
    """
    plain = re.sub(f"[^A-Za-z0-9{re.escape(keep)}]+", "-", name).strip("-.")
    return plain[:_LONGEST].rstrip("-.") or "campaign"


def campaign_folder_name(name: str, started: datetime) -> str:
    """`<name>-YYYY-MM-DD-HHMMSS`."""
    return f"{campaign_prefix(name)}-{started:%Y-%m-%d-%H%M%S}"


def is_campaign_dir(path: str | Path) -> bool:
    """True for names of campaign folders; those of `run.sh` include hundredths of a second."""
    return _CAMPAIGN.match(Path(path).name) is not None


def is_run_number(name: str) -> bool:
    """True for names of run folders: `00` is none, since two folders would then be run 0."""
    return _RUN.fullmatch(name) is not None


def holds_campaign(folder: Path) -> bool:
    """True for a folder with the content of a campaign, whatever its name.

    Campaigns of other tools are recognized by a report `<configuration>/<run>/test.xml`.
    """
    own = any(os.path.isdir(folder / name) for name in (EXECUTION, TRANSIENT))
    has_document = any(name.endswith(".vast") for name in _names(folder / CONFIG))
    return own or has_document or any(_holds_reports(folder / name) for name in _names(folder))


def _holds_reports(configuration: Path) -> bool:
    """Whether a folder has reports of another tool, whose configurations have no `_config`."""
    if configuration.name.startswith((".", "_")) or is_campaign_dir(configuration):
        return False
    names = _names(configuration)
    return CONFIG not in names and any(
        is_run_number(name) and os.path.lexists(configuration / name / TEST_RESULT)
        for name in names
    )


def _names(folder: Path) -> list[str]:
    """The names in a folder; none if it is missing or cannot be read, as a link to nowhere."""
    try:
        return os.listdir(folder)
    except OSError:
        return []


def get_campaign(name: str = "campaign") -> str:
    """A new campaign folder's name."""
    return campaign_folder_name(name, datetime.now().astimezone())


def get_campaign_timestamp(name: str | Path) -> str | None:
    """The `YYYY-MM-DD-HHMMSS[cc]` of a campaign folder's name, or None."""
    match = _CAMPAIGN.match(Path(name).name)
    return match["timestamp"] if match else None


def campaign_time(name: str | Path) -> datetime | None:
    """Start of a campaign, to the second, from its folder's name; None for other names."""
    timestamp = get_campaign_timestamp(name) or ""
    try:
        return datetime.strptime(timestamp[:17], "%Y-%m-%d-%H%M%S")
    except ValueError:
        return None

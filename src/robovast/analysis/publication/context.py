"""The context of a publication, for plugins with a parameter named `context`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from robovast.base.errors import DocumentError, InputError, StorageError
from robovast.base.yaml_files import read_mapping
from robovast.campaign.discovery import find_campaigns
from robovast.campaign.layout import Layout
from robovast.model.document.model import ResultsProcessing
from robovast.model.document.problems import problems_of
from robovast.model.document.section import PluginCall
from robovast.model.document.source import Source
from robovast.model.naming import campaign_time


@dataclass(frozen=True)
class PublicationCampaign:
    """A campaign to publish."""

    path: Path
    metadata: Mapping[str, Any]
    """The `metadata:` section of its .vast file."""

    @property
    def name(self) -> str:
        """Name of its folder."""
        return self.path.name

    @property
    def started(self) -> datetime | None:
        """Start of the campaign, from its name."""
        return campaign_time(self.name)


def _refuse(path: Path) -> bool:
    raise StorageError(
        f"{path} exists already and differs",
        hint="use `--force` or `overwrite: true` to replace it, or `overwrite: false` to keep it",
    )


@dataclass(frozen=True)
class PublicationContext:
    """The campaigns to publish, and archives made by previous plugins."""

    campaigns: tuple[PublicationCampaign, ...]
    files: tuple[Path, ...] = ()
    """Archives made by previous plugins."""
    confirm: Callable[[Path], bool] = _refuse
    """Asks whether to replace an existing file."""
    progress: Callable[[str, int, int], None] = field(default=lambda _name, _done, _total: None)
    """Reports the progress of a file: bytes done, and all bytes."""


@dataclass(frozen=True)
class Settings:
    """The publication section of a .vast file."""

    vast_file: Path
    calls: tuple[PluginCall, ...]
    metadata: Mapping[str, Any]


def read_settings(vast_file: Path) -> Settings:
    """Read the publication section of a .vast file; other sections may be of any version.

    Raises:
        InputError: the file cannot be read.
        DocumentError: its `publication` is invalid.
    """
    source = Source.read(vast_file)
    data = source.data if isinstance(source.data, dict) else {}
    section = data.get("results_processing")
    calls = section.get("publication") if isinstance(section, dict) else None
    metadata = data.get("metadata")
    try:
        valid = ResultsProcessing.model_validate({"publication": calls or []})
    except ValidationError as error:
        raise DocumentError(
            problems_of(error, source, ResultsProcessing, ("results_processing",))
        ) from error
    return Settings(
        vast_file, tuple(valid.publication), metadata if isinstance(metadata, dict) else {}
    )


def snapshot(campaign: Path) -> Path:
    """The .vast file in a campaign's `_config` folder.

    Raises:
        InputError: there is none, or there are several candidates.
    """
    found = Layout(campaign).documents
    if len(found) > 1:
        recorded = read_mapping(Layout(campaign).configurations).get("vast")
        found = [path for path in found if path.name == recorded]
    if not found:
        raise InputError(
            f"{campaign}: `_config` does not contain the .vast file of the campaign",
            hint="name it with `--override FILE`",
        )
    return found[0]


def context_of(results_dir: Path) -> PublicationContext:
    """A context of all campaigns in a results folder."""
    return PublicationContext(
        tuple(
            PublicationCampaign(path, read_settings(snapshot(path)).metadata)
            for path in find_campaigns(results_dir)
        )
    )

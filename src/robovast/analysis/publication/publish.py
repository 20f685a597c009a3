"""Publishes campaigns as configured in their .vast files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from robovast.analysis.publication.context import (
    PublicationCampaign,
    PublicationContext,
    Settings,
    read_settings,
    snapshot,
)
from robovast.analysis.publication.plugin import UPLOAD, PublicationPlugin
from robovast.base.errors import InputError
from robovast.base.serialization import fingerprint


@dataclass(frozen=True)
class PublishOptions:
    """Options of publication."""

    force: bool = False
    """Replace what exists."""
    skip_upload: bool = False
    """Only pack."""


@dataclass(frozen=True)
class PublicationBatch:
    """Campaigns that are published together."""

    settings: Settings
    campaigns: tuple[PublicationCampaign, ...]
    plugins: tuple[PublicationPlugin, ...] = ()
    """The plugins, in order of execution."""

    @property
    def results_dir(self) -> Path:
        """Folder of the campaigns."""
        return self.campaigns[0].path.parent

    @property
    def config_dir(self) -> Path:
        """Folder of the .vast file."""
        return self.settings.vast_file.parent


def plan_publication(
    campaigns: Sequence[Path], override: Path | None, known: int, options: PublishOptions
) -> list[PublicationBatch]:
    """Group campaigns with the same publication settings.

    Args:
        campaigns: their folders, in one folder.
        override: a .vast file that replaces those in the campaigns.
        known: number of campaigns in that folder.
        options: how to publish.

    Raises:
        InputError: a .vast file, a plugin or its call is missing or invalid, or there is nothing to
            publish.
    """
    batches: dict[str, PublicationBatch] = {}
    for path in campaigns:
        settings = read_settings(override or snapshot(path))
        key = fingerprint([call.model_dump() for call in settings.calls])
        before = batches[key].campaigns if key in batches else ()
        batches[key] = PublicationBatch(
            settings, (*before, PublicationCampaign(path, settings.metadata))
        )
    found = [batch for batch in batches.values() if batch.settings.calls]
    if not found:
        names = ", ".join(str(batch.settings.vast_file) for batch in batches.values())
        raise InputError(
            f"there is nothing to publish: there is no `results_processing.publication` in {names}",
            hint="add it, or name a .vast file that has it with `--override FILE`",
        )
    return [replace(batch, plugins=_plugins(batch, known, options)) for batch in found]


def publish(
    batches: Iterable[PublicationBatch],
    options: PublishOptions,
    context: PublicationContext,
    report: Callable[[str], None],
) -> None:
    """Call all plugins after all their checks; the first failure ends the publication.

    Args:
        batches: what to publish.
        options: how to publish.
        context: callbacks of the plugins; its campaigns and files are set here.
        report: receives each plugin's message.

    Raises:
        RobovastError: a plugin failed.
    """
    listed = list(batches)
    for batch in listed:
        about = replace(context, campaigns=batch.campaigns, files=())
        for plugin in batch.plugins:
            plugin.check(batch.results_dir, batch.config_dir, about)
    for batch in listed:
        context = replace(context, campaigns=batch.campaigns, files=())
        for plugin in batch.plugins:
            folders = (batch.results_dir, batch.config_dir)
            message, files = plugin.publish(*folders, context, force=options.force)
            context = replace(context, files=(*context.files, *files))
            report(f"{plugin.name}: {message}")


def _plugins(
    batch: PublicationBatch, known: int, options: PublishOptions
) -> tuple[PublicationPlugin, ...]:
    folder = batch.settings.vast_file.absolute().parent
    plugins = [PublicationPlugin.load(call, folder) for call in batch.settings.calls]
    chosen = [item for item in plugins if not (options.skip_upload and item.kind == UPLOAD)]
    for plugin in chosen:
        if not plugin.takes_context and len(batch.campaigns) < known:
            raise InputError(
                f"the publication plugin `{plugin.name}` publishes the whole results folder, with "
                f"{known} campaigns, not only {', '.join(item.name for item in batch.campaigns)}",
                hint="move the others elsewhere, or publish all by one file with `--override FILE`",
            )
    return tuple(sorted(chosen, key=lambda plugin: plugin.kind == UPLOAD))

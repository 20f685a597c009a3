"""The publication plugin `zip`: packs each campaign reproducibly, equal files to equal bytes."""

from __future__ import annotations

import os
import re
import shutil
import stat
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from filecmp import cmp
from pathlib import Path, PurePosixPath
from typing import Any

from robovast.analysis.publication.context import (
    PublicationCampaign,
    PublicationContext,
    context_of,
)
from robovast.analysis.publication.ro_crate import FILE_NAME as RO_CRATE
from robovast.analysis.publication.ro_crate import ro_crate
from robovast.analysis.publication.selection import Filter, archive_path, files_of, link_target
from robovast.base.atomic import appearing_file
from robovast.base.errors import InputError, StorageError
from robovast.base.safe_paths import MOST_OF_ALL, open_file, read_file
from robovast.base.serialization import dump_yaml
from robovast.base.sizes import fmt_size
from robovast.base.yaml_files import read_mapping
from robovast.campaign.layout import EXECUTION_RECORD, RUN_RECORD, TEST_RESULT
from robovast.model.naming import METADATA, get_campaign_timestamp

CHUNK = 2**20
"""How much of a file is held in memory [byte]."""
COMPRESSED = frozenset(
    {".gz", ".jpg", ".mcap", ".mp4", ".parquet", ".png", ".webm", ".zip", ".zst"}
)
"""Suffixes of files that are already compressed."""

_PLACEHOLDER = re.compile(r"\{([^{}]*)\}")


@dataclass(frozen=True)
class ZipOptions:
    """Options for the content of an archive."""

    filter: Filter
    omit_hidden: bool
    metadata: Mapping[str, Any]
    """Added to the `metadata` section of metadata.yaml."""

    @classmethod
    def of(
        cls,
        include_filter: Sequence[str] | None = None,
        exclude_filter: Sequence[str] = (),
        omit_hidden: bool = False,
        metadata: Mapping[str, Any] | None = None,
        **_others: Any,
    ) -> ZipOptions:
        """The options in a document's parameters."""
        return cls(Filter(include_filter, exclude_filter), omit_hidden, metadata or {})


class ZipArchives:
    """Packs each campaign into a zip file; equal files produce equal bytes."""

    def check(
        self,
        results_dir: str,
        config_dir: str,
        context: PublicationContext,
        filename: str | None = None,
        destination: str | None = None,
        **options: Any,
    ) -> None:
        """Check the names of all archives and the paths of all files in them.

        Raises:
            InputError: a name or path is invalid or occurs twice.
        """
        del config_dir
        chosen = ZipOptions.of(**options)
        folder = Path(results_dir) / (destination or ".")
        for campaign, _ in _targets(context.campaigns, folder, filename):
            _Archive(campaign, chosen).members()

    def __call__(
        self,
        results_dir: str,
        config_dir: str,
        filename: str | None = None,
        include_filter: Sequence[str] | None = None,
        exclude_filter: Sequence[str] = (),
        destination: str | None = None,
        overwrite: bool | None = None,
        omit_hidden: bool = False,
        metadata: Mapping[str, Any] | None = None,
        context: PublicationContext | None = None,
    ) -> tuple[bool, str, list[str]]:
        """Pack every campaign into a zip file.

        Args:
            results_dir: folder of the campaigns.
            config_dir: not used.
            filename: template with `{timestamp}` and keys of the document's `metadata`; by default
                the name of the campaign's folder.
            include_filter: globs of the files to pack; by default all. Globs without `/` are
                matched against the file's name, others from the campaign's folder.
            exclude_filter: globs of files to leave out, even if they are included.
            destination: folder of the archives, relative to the results; the results when omitted.
            overwrite: replace existing archives (true), keep them (false), or ask.
            omit_hidden: leave folders whose names begin with `_` out of the paths in the archive.
            metadata: fields for the `metadata` section of the archive's metadata.yaml, such as
                `title`.
            context: what to publish; by default all campaigns in the folder.
        """
        del config_dir  # everything is relative to the results
        context = context or context_of(Path(results_dir))
        options = ZipOptions.of(include_filter, exclude_filter, omit_hidden, metadata)
        folder = Path(results_dir) / (destination or ".")
        targets = _targets(context.campaigns, folder, filename)
        said = []
        for campaign, target in targets:
            if os.path.exists(target) and overwrite is False:
                said.append(f"{target.name} kept")
                continue
            said.append(_pack(campaign, target, options, context, ask=overwrite is None))
        return True, "; ".join(said), [str(target.absolute()) for _, target in targets]


zip_results = ZipArchives()


def _targets(
    campaigns: Sequence[PublicationCampaign], folder: Path, template: str | None
) -> list[tuple[PublicationCampaign, Path]]:
    found: dict[Path, PublicationCampaign] = {}
    for campaign in campaigns:
        target = folder / _file_name(template, campaign)
        if target in found:
            raise InputError(
                f"{found[target].name} and {campaign.name} would both be packed into {target}",
                hint="let `filename` contain `{timestamp}`, or publish them one by one with `-i`",
            )
        found[target] = campaign
    return [(campaign, target) for target, campaign in found.items()]


def _file_name(template: str | None, campaign: PublicationCampaign) -> str:
    if template is None:
        return f"{campaign.name}.zip"
    values = {key: str(value) for key, value in campaign.metadata.items()}
    values["timestamp"] = get_campaign_timestamp(campaign.name) or campaign.name
    unknown = [name for name in _PLACEHOLDER.findall(template) if name not in values]
    if unknown:
        raise InputError(
            "the `filename` of the publication plugin `zip` has the placeholder "
            f"`{{{unknown[0]}}}`, which is not in the document's `metadata`",
            hint=f"use one of {', '.join(sorted(values))}",
        )
    name = _PLACEHOLDER.sub(lambda match: values[match[1]], template)
    if "/" in name or name in {"", ".", ".."}:
        raise InputError(
            f"the `filename` of the publication plugin `zip` results in `{name}`, which is not a "
            "file name",
            hint="use `destination` for the folder",
        )
    return name


def _pack(
    campaign: PublicationCampaign,
    target: Path,
    options: ZipOptions,
    context: PublicationContext,
    *,
    ask: bool,
) -> str:
    """Write an archive; return its summary."""
    with appearing_file(target) as part:
        packed = _Archive(campaign, options)
        packed.write(part)
        size, replaced = fmt_size(part.stat().st_size), os.path.exists(target)
        if replaced and cmp(part, target, shallow=False):
            part.unlink()
            return f"{target.name} is up to date ({size}){packed.remark}"
        if replaced and ask and not context.confirm(target):
            part.unlink()
            return f"{target.name} kept"
    return f"{target.name}: {packed.count} files, {size}{packed.remark}"


class _Archive:
    """One campaign's archive in progress."""

    def __init__(self, campaign: PublicationCampaign, options: ZipOptions) -> None:
        self.count = 0
        self.remark = ""
        self._campaign = campaign
        self._options = options
        # File times depend on copying, and would change the bytes.
        self._time = (campaign.started or datetime(1980, 1, 1)).timetuple()[:6]

    def members(self) -> tuple[dict[str, Path], dict[str, str]]:
        """Files by archive path, and targets of links; the target of links that leave it is empty.

        Raises:
            InputError: two files have the same path.
        """
        links: dict[str, str] = {}
        files: dict[str, Path] = {}
        for inside, source in self._chosen():
            if inside in files or inside in links:
                raise InputError(
                    f"{self._campaign.name}: two files would be `{inside}` in the archive",
                    hint="remove `omit_hidden`, which keeps their folders apart",
                )
            if os.path.islink(source):
                links[inside] = self._link(source)
            else:
                files[inside] = source
        return files, links

    def write(self, path: Path) -> None:
        """Write the whole archive."""
        files, links = self.members()
        self.remark = self._dropped([*files, *links])
        outside = [inside for inside, target in links.items() if not target]
        if outside:
            self.remark += f", without {len(outside)} links that leave the campaign"
        made = self._created_files([*files, *links])
        names = sorted({*files, *links, *made} - set(outside))
        with zipfile.ZipFile(path, "w") as archive:
            for name in names:
                if name in made:
                    archive.writestr(self._info(name), made[name])
                elif name in links:
                    info = self._info(name, stat.S_IFLNK | 0o777)
                    archive.writestr(info, os.fsencode(links[name]))
                else:
                    self._add(archive, name, files[name])
        self.count = len(names)

    def _chosen(self) -> Iterator[tuple[str, Path]]:
        omit = self._options.omit_hidden
        for relative, path in files_of(self._campaign.path):
            if self._options.filter.takes(relative) and relative not in {METADATA, RO_CRATE}:
                yield archive_path(relative, omit_hidden=omit), path

    def _dropped(self, kept: Sequence[str]) -> str:
        """Warn of filters that drop the records without which a run counts as not executed."""
        stored = [PurePosixPath(relative).name for relative, _ in files_of(self._campaign.path)]
        packed = [PurePosixPath(name).name for name in kept]
        for name in (RUN_RECORD, TEST_RESULT):
            if count := stored.count(name) - packed.count(name):
                return (
                    f", without {count} `{name}`, so that the archive lacks these runs: "
                    f"use globs in `include_filter` and `exclude_filter` that keep `{name}`"
                )
        return ""

    def _link(self, link: Path) -> str:
        root, omit = self._campaign.path, self._options.omit_hidden
        return link_target(root, link.relative_to(root).as_posix(), link, omit_hidden=omit) or ""

    def _created_files(self, names: Sequence[str]) -> dict[str, bytes]:
        """Files that every archive has regardless of filters."""
        metadata = _metadata(self._campaign.path, self._options.metadata)
        made = {METADATA: metadata} if metadata is not None else {}
        described = {**self._campaign.metadata, **self._options.metadata}
        execution = read_mapping(self._campaign.path / EXECUTION_RECORD)
        made[RO_CRATE] = ro_crate(self._campaign, described, execution, [*names, *made])
        return made

    def _add(self, archive: zipfile.ZipFile, name: str, source: Path) -> None:
        try:
            content = open_file(source)
        except OSError as error:
            raise StorageError(f"{source}: cannot be read: {error.strerror}.") from error
        with content:
            found = os.fstat(content.fileno())
            info = self._info(name, stat.S_IFREG | (0o755 if found.st_mode & 0o100 else 0o644))
            info.file_size = found.st_size
            if source.suffix in COMPRESSED:
                info.compress_type = zipfile.ZIP_STORED
            with archive.open(info, "w") as member:
                shutil.copyfileobj(content, member, CHUNK)

    def _info(self, name: str, mode: int = stat.S_IFREG | 0o644) -> zipfile.ZipInfo:
        info = zipfile.ZipInfo(f"{self._campaign.name}/{name}", self._time)
        info.create_system = 3  # Unix, for the mode
        info.external_attr = mode << 16
        info.compress_type = zipfile.ZIP_DEFLATED
        return info


def _metadata(campaign: Path, fields: Mapping[str, Any]) -> bytes | None:
    """The content of metadata.yaml with additional fields in its `metadata` section."""
    path = campaign / METADATA
    if not fields:
        return read_file(path, most=MOST_OF_ALL) if os.path.isfile(path) else None
    found = read_mapping(path)
    section = found.get("metadata")
    known = section if isinstance(section, dict) else {}
    return dump_yaml({**found, "metadata": {**known, **fields}}).encode()

"""Campaigns on a share: listing, downloading, removing."""

from __future__ import annotations

import fnmatch
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from robovast.base.atomic import put_in_place
from robovast.base.environment import dotenv_loaded
from robovast.base.errors import InputError, RobovastError, StorageError, one_of
from robovast.base.file_errors import writing
from robovast.base.plugins import load_plugin, plugins_of, raised, split_file_reference
from robovast.campaign.importing import campaign_of_archive, import_archive
from robovast.storage.shares.base import BaseShareProvider, check_variables

GROUP = "robovast.share_providers"
SHARE_TYPE = "ROBOVAST_SHARE_TYPE"
SUFFIX = ".tar.gz"
FETCHED = ".from-share"
"""Folder next to the campaigns that holds archives until their campaigns are complete."""
_GLOB = frozenset("*?[")

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SharedCampaign:
    """A campaign's archive on a share."""

    archive: str
    """Its file name."""
    size: int
    """[byte]"""

    @property
    def name(self) -> str:
        """The campaign's name."""
        return campaign_of_archive(self.archive)


class NotOnShareError(InputError):
    """A campaign is not on the share."""


class Share:
    """A share, accessed through its provider; all errors are meant for users."""

    def __init__(self, provider: BaseShareProvider) -> None:
        self.provider = provider

    def campaigns(self) -> list[SharedCampaign]:
        """All campaigns on the share, sorted by name."""
        with self._storage_errors("list its archives"):
            found = self.provider.list_campaign_archives_with_size()
            return sorted(
                (
                    SharedCampaign(str(name), int(size))
                    for name, size in found
                    if _is_file_name(str(name))
                ),
                key=lambda item: item.archive,
            )

    def chosen(self, names: Sequence[str]) -> list[SharedCampaign]:
        """The named campaigns, or all; warns of globs without match.

        Raises:
            NotOnShareError: a campaign is not on the share.
        """
        known = {item.name: item for item in self.campaigns()}
        found: list[str] = []
        for name in (given.removesuffix(SUFFIX) for given in names):
            matching = [name] if name in known else fnmatch.filter(known, name)
            if not matching and not _GLOB.intersection(name):
                raise NotOnShareError(
                    f"no campaign `{name}` on the file share",
                    hint=one_of(known, "upload a campaign to the file share first"),
                )
            if not matching:
                _log.warning("no campaign on the file share matches `%s`.", name)
            found += matching
        return [known[name] for name in dict.fromkeys(found)] if names else list(known.values())

    def verify(self) -> None:
        """Check, as far as possible in advance, that archives can be uploaded; raise if not."""
        with self._storage_errors("be used"):
            self.provider.verify_access()

    def has(self, campaign: str) -> bool:
        """Whether a campaign's archive is on the share."""
        with self._storage_errors(f"look for {campaign}"):
            return self.provider.archive_exists_on_share(f"{campaign}{SUFFIX}")

    def put(self, archive: Path, progress: Callable[[int, int], None]) -> None:
        """Upload an archive under its own name; an existing one is replaced.

        Args:
            archive: the file.
            progress: called with the number of sent bytes, and of all bytes.
        """
        with self._storage_errors(f"take {archive.name}"):
            self.provider.upload_archive(str(archive), archive.name, progress)

    def remove(self, campaign: SharedCampaign) -> None:
        """Remove a campaign from the share."""
        with self._storage_errors(f"remove {campaign.archive}"):
            self.provider.remove_archive(campaign.archive)

    def fetch(
        self, campaign: SharedCampaign, target: Path, progress: Callable[[int, int], None]
    ) -> None:
        """Download a campaign's archive, resuming an earlier attempt.

        Raises:
            StorageError: the download is incomplete.
        """
        part = target.with_name(f".{target.name}.{campaign.size}.part")
        here = part.stat().st_size if part.exists() else 0
        with self._storage_errors(f"download {campaign.archive}"):
            if here < campaign.size:
                self.provider.download_archive(campaign.archive, str(part), progress, here)
            elif here > campaign.size:
                part.unlink()
        found = part.stat().st_size if part.exists() else 0
        if found != campaign.size:
            raise StorageError(
                f"{found} of {campaign.size} bytes of {campaign.archive} are downloaded",
                hint="try again to download the rest",
            )
        put_in_place(part, target)

    @contextmanager
    def _storage_errors(self, what: str) -> Iterator[None]:
        try:
            yield
        except RobovastError:
            raise
        except Exception as error:
            raise StorageError(
                f"the share `{self.provider.SHARE_TYPE}` cannot {what}: {raised(error)}"
            ) from error


@contextmanager
def open_share(folder: Path | None = None) -> Iterator[Share]:
    """The share configured in the environment or a `.env` file.

    Args:
        folder: where to search for a `.env` file, also above it; by default the working
            directory.

    Raises:
        InputError: no share is configured, or variables are missing.
    """
    chosen = os.environ.get(SHARE_TYPE)
    with dotenv_loaded(folder):
        kind = os.environ.get(SHARE_TYPE)
        if kind and not chosen and split_file_reference(kind):
            raise InputError(
                f"{SHARE_TYPE}={kind}: a `.env` file cannot name a file with code",
                hint=f"set the variable in the environment: `export {SHARE_TYPE}={kind}`",
            )
        if not kind:
            raise InputError(
                "there is no share",
                hint=f"set {SHARE_TYPE} to one of {', '.join(sorted(plugins_of(GROUP)))}, in the "
                "environment or a `.env` file",
            )
        share = Share(load_provider(kind, folder or Path.cwd()))
        check_variables(share.provider)
        yield share


def download_from_share(
    share: Share,
    names: Sequence[str],
    output: Path,
    *,
    force: bool = False,
    keep_archive: bool = False,
    progress: Callable[[str, int, int], None] = lambda _name, _done, _total: None,
) -> tuple[list[Path], list[Path]]:
    """Download campaigns from a share, each completely or not at all.

    Args:
        share: the share.
        names: the campaigns; all if empty.
        output: parent of the campaigns' folders.
        force: also download campaigns that exist here.
        keep_archive: keep `<campaign>.tar.gz` beside the campaign's folder.
        progress: called with a campaign, the number of bytes that are here, and of all bytes.

    Returns:
        Folders of downloaded campaigns, and of those that existed already.

    Raises:
        InputError: a campaign is not on the share, its archive is damaged or unsafe, or an
            archive that is to be kept would replace another file.
        StorageError: a campaign cannot be downloaded or written.
    """
    fetched, present = [], []
    for campaign in share.chosen(names):
        folder = output / campaign.name
        if folder.exists() and not force:
            present.append(folder)
            continue
        with writing(output):
            fetched.append(_bring(share, campaign, output, force, keep_archive, progress))
    return fetched, present


def _bring(
    share: Share,
    campaign: SharedCampaign,
    output: Path,
    force: bool,
    keep_archive: bool,
    progress: Callable[[str, int, int], None],
) -> Path:
    kept = output / campaign.archive
    if keep_archive and not force and os.path.lexists(kept):
        raise InputError(
            f"{kept}: exists already",
            hint="move it away, or replace it with `--force`. Without `--keep-archive`, it "
            "stays as it is",
        )
    own = output / FETCHED
    own.mkdir(parents=True, exist_ok=True)
    archive = own / campaign.archive
    try:
        share.fetch(campaign, archive, partial(progress, campaign.name))
        try:
            return import_archive(archive, output, force=force)
        finally:
            if keep_archive:
                put_in_place(archive, kept)
            else:
                archive.unlink()
    finally:
        with suppress(OSError):  # it may have parts of archives, to be resumed
            own.rmdir()


def load_provider(kind: str, folder: Path) -> BaseShareProvider:
    """Create the provider of a kind of share.

    Args:
        kind: value of `ROBOVAST_SHARE_TYPE`: a plugin's name, or `<path>.py:<class>`.
        folder: base of such a path.

    Raises:
        InputError: the provider is missing or invalid.
        CannotRunError: required packages are missing.
    """
    provider_class = load_plugin(kind, GROUP, folder)
    if not (isinstance(provider_class, type) and issubclass(provider_class, BaseShareProvider)):
        raise InputError(
            f"the share provider `{kind}` is not a subclass of BaseShareProvider.",
            hint="write a class that inherits from BaseShareProvider",
        )
    try:
        return provider_class()
    except RobovastError:
        raise
    except Exception as error:
        raise InputError(
            f"the share provider `{kind}` cannot be created: {type(error).__name__}: {error}"
        ) from error


def _is_file_name(name: str) -> bool:
    return Path(name).name == name and not name.startswith(".")

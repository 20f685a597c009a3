"""Records which campaign a folder of results belongs to, since names and times may be equal.

The folder of a cluster campaign contains the owner of its bucket. A folder without owner belongs to
a local campaign, or to a bucket that another tool made.
"""

from __future__ import annotations

from pathlib import Path

from robovast.base.atomic import write_atomically
from robovast.base.errors import StorageError
from robovast.base.safe_paths import read_file
from robovast.campaign.layout import STAGE
from robovast.model.naming import get_campaign_timestamp
from robovast.model.packs import Owner
from robovast.storage.bucket_names import uid_digits
from robovast.storage.bucket_ownership import OWNER, OtherOwnerError, parse_owner


def folder_for(results: Path, campaign: str, owner: Owner | None) -> Path:
    """Folder for the campaign of a bucket: `<campaign>`, unless that belongs to another campaign.

    Another campaign with the same name and second is `<name>-<start of its uid>-<timestamp>`, and
    stays there when the first one is gone.

    Args:
        results: the results folder.
        campaign: name of the campaign's own folder.
        owner: owner of its bucket.
    """
    wanted = results / campaign
    if owner is None or _owner_of(wanted) == owner:
        return wanted
    distinct = results / distinct_name(campaign, owner.uid)
    if _owner_of(distinct) != owner and _is_free_for(wanted, owner):
        return wanted
    return distinct


def distinct_name(campaign: str, uid: str) -> str:
    """Name of a campaign's folder if another campaign has the same name and second."""
    timestamp = get_campaign_timestamp(campaign) or ""
    name = campaign.removesuffix(f"-{timestamp}")
    return "-".join(filter(None, (name, uid_digits(uid), timestamp)))


def occupy(folder: Path, owner: Owner | None) -> None:
    """Record the owner of a campaign's folder before anything else is written to it.

    Args:
        folder: the campaign's folder.
        owner: owner of the downloaded bucket; None if it has none.

    Raises:
        OtherOwnerError: the folder belongs to another campaign.
        OSError: the folder cannot be written.
    """
    if not _is_free_for(folder, owner):
        found = _owner_of(folder)
        raise OtherOwnerError(
            f"{folder} contains {found or 'a campaign of this machine, or of another tool'}, but "
            f"the download belongs to {owner or 'another tool'}, so they are kept apart",
            hint="download it to another folder",
        )
    if owner is not None and _owner_of(folder) is None:
        (folder / OWNER).parent.mkdir(parents=True, exist_ok=True)
        write_atomically(folder / OWNER, owner.model_dump_json())


def _is_free_for(folder: Path, owner: Owner | None) -> bool:
    found = _owner_of(folder)
    if found is not None or owner is None:
        return found == owner
    return not folder.exists() or all(path.name == STAGE for path in folder.iterdir())


def _owner_of(folder: Path) -> Owner | None:
    try:
        return parse_owner(read_file(folder / OWNER), f"{folder}")
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise StorageError(f"{error.filename}: cannot be read: {error.strerror}.") from error

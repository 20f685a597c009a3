"""Which campaign a folder of results belongs to: two may be of one name and one second.

A campaign of a cluster has the owner of its bucket in its folder. A folder without one is of a
local campaign, or of a bucket of an older version.
"""

from __future__ import annotations

from pathlib import Path

from robovast.base.atomic import write_atomically
from robovast.base.errors import StorageError
from robovast.campaign.layout import STAGE
from robovast.model.naming import get_campaign_timestamp
from robovast.model.packs import Owner
from robovast.storage.bucket_names import uid_digits
from robovast.storage.ownership import OWNER, OtherOwnerError, parse_owner


def folder_for(results: Path, campaign: str, owner: Owner | None) -> Path:
    """Where a campaign of a bucket goes: `<campaign>`, unless that folder is another's.

    A second campaign of one name and second is `<name>-<first digits of its uid>-<timestamp>`.

    Args:
        results: the results folder.
        campaign: name of the campaign's own folder.
        owner: of its bucket.
    """
    wanted = results / campaign
    if owner is None or _is_free_for(wanted, owner):
        return wanted
    return results / distinct_name(campaign, owner.uid)


def distinct_name(campaign: str, uid: str) -> str:
    """Name of a campaign's folder where there is another one of its name and second."""
    timestamp = get_campaign_timestamp(campaign) or ""
    name = campaign.removesuffix(f"-{timestamp}")
    return "-".join(filter(None, (name, uid_digits(uid), timestamp)))


def occupy(folder: Path, owner: Owner | None) -> None:
    """Note in a campaign's folder whose it is, before anything else is in it.

    Args:
        folder: the campaign's.
        owner: of the bucket that is brought into it; None when that has none.

    Raises:
        OtherOwnerError: it is another's.
        OSError: it cannot be written.
    """
    if not _is_free_for(folder, owner):
        found = _owner_of(folder)
        raise OtherOwnerError(
            f"{folder}: holds {found or 'a campaign of this machine, or of an older version'}, "
            f"and what is fetched is of {owner or 'an older version'}; they are not mixed. "
            "Fetch it into another folder."
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
        return parse_owner((folder / OWNER).read_bytes(), f"{folder}")
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise StorageError(f"{error.filename}: cannot be read: {error.strerror}.") from error

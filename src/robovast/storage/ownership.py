"""Whose a bucket is: an object that is made before everything else in it, and never changes.

A bucket without one is of an older version, or nobody's yet.
"""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from pydantic import ValidationError

from robovast.base.errors import InputError, StorageError
from robovast.model.naming import TRANSIENT
from robovast.model.packs import Owner
from robovast.storage.bucket_names import buckets_of

if TYPE_CHECKING:
    from robovast.storage.s3 import ObjectStore

OWNER = f"{TRANSIENT}/owner.json"


class OtherOwnerError(StorageError):
    """A bucket, or a folder, belongs to another campaign."""


_LARGEST = 64 * 1024
"""Of what says whose a bucket is [byte]."""


def owner_of(store: ObjectStore, bucket: str) -> Owner | None:
    """Whose a bucket is; None when nobody has claimed it.

    Raises:
        OtherOwnerError: it is not known, since the object is not what this program writes.
        StorageError: the bucket cannot be read.
    """
    content = store.read(bucket, OWNER, _LARGEST)
    return parse_owner(content, f"the bucket {bucket}") if content is not None else None


def find_bucket(store: ObjectStore, name: str) -> tuple[str, Owner | None] | None:
    """The bucket of a campaign, and whose it is; None when there is none.

    Args:
        store: where it is.
        name: of the results folder, or of the bucket.

    Raises:
        InputError: campaigns of one second have that name.
    """
    owners = {bucket: owner_of(store, bucket) for bucket in buckets_of(name, store.buckets())}
    found = [
        (bucket, owner)
        for bucket, owner in owners.items()
        if owner is None or name in {bucket, owner.campaign}
    ]
    if len(found) > 1:
        told = ", ".join(f"{bucket} of {owner or 'an older version'}" for bucket, owner in found)
        raise InputError(f"several campaigns are called {name}; name the bucket of one: {told}.")
    return found[0] if found else None


def parse_owner(content: bytes, place: str) -> Owner:
    """An owner as it is written.

    Raises:
        OtherOwnerError: it is none.
    """
    unknown = f"{place}: whose it is cannot be read in {OWNER}, so it is left alone."
    try:
        owner = Owner.model_validate_json(content)
    except ValidationError as error:
        raise OtherOwnerError(unknown) from error
    if not (_is_name(owner.campaign) and _is_name(owner.uid)):  # folders are called so
        raise OtherOwnerError(unknown)
    return owner


def _is_name(text: str) -> bool:
    """True for what can be the name of a file, and is no path to another place."""
    return PurePosixPath(text).name == text and text not in {"", ".."} and "\0" not in text


def claim(store: ObjectStore, bucket: str, owner: Owner) -> None:
    """Make a bucket, and make it a campaign's own; nothing happens when it is.

    Raises:
        OtherOwnerError: it is another's.
        StorageError: it cannot be made, read or written.
    """
    if not is_owned(store, bucket, owner.uid):
        store.make_bucket(bucket)
        if not store.create(bucket, OWNER, owner.model_dump_json().encode()):
            is_owned(store, bucket, owner.uid)


def is_owned(store: ObjectStore, bucket: str, uid: str | None) -> bool:
    """True when a bucket is that Campaign's, False when it is nobody's.

    Args:
        store: where it is.
        bucket: its name.
        uid: of the Campaign; None for one of an older version, which owns none.

    Raises:
        OtherOwnerError: it is another's.
        StorageError: it cannot be read.
    """
    found = owner_of(store, bucket)
    if found is not None and found.uid != uid:
        asking = f"the one with the uid {uid}" if uid else "the one that asks for it"
        raise OtherOwnerError(
            f"the bucket {bucket} belongs to {found}, not to {asking}; nothing in it is read, "
            "written or removed for another. Give this Campaign a bucket of its own: another "
            "name, or another `spec.storage.prefix`."
        )
    return found is not None

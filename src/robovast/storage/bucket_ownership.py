"""The owner of a bucket: an object that is created first and never changes.

A bucket without owner was made by another tool, such as RoboVAST 1.x: it can be downloaded, and
nothing is written to it.
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
    """A bucket or folder belongs to another campaign."""


_LARGEST = 64 * 1024
"""Largest size of the owner object [byte]."""


def owner_of(store: ObjectStore, bucket: str) -> Owner | None:
    """The owner of a bucket; None if nobody has claimed it.

    Raises:
        OtherOwnerError: the owner is unknown, since the object has another format.
        StorageError: the bucket cannot be read.
    """
    content = store.read(bucket, OWNER, _LARGEST)
    return parse_owner(content, f"the bucket {bucket}") if content is not None else None


def find_bucket(store: ObjectStore, name: str) -> tuple[str, Owner | None] | None:
    """The bucket of a campaign and its owner; None if there is none.

    Args:
        store: the S3 server.
        name: name of the results folder or of the bucket.

    Raises:
        InputError: several campaigns have that name.
    """
    owners = {bucket: owner_of(store, bucket) for bucket in buckets_of(name, store.buckets())}
    found = [
        (bucket, owner)
        for bucket, owner in owners.items()
        if owner is None or name in {bucket, owner.campaign}
    ]
    if len(found) > 1:
        told = ", ".join(f"{bucket} of {owner or 'another tool'}" for bucket, owner in found)
        raise InputError(
            f"several campaigns are called {name}", hint=f"name the bucket of one: {told}"
        )
    return found[0] if found else None


def parse_owner(content: bytes, place: str) -> Owner:
    """Parse an owner object.

    Raises:
        OtherOwnerError: the content is invalid.
    """
    unknown = f"{place}: its owner cannot be read from {OWNER}, so it is not touched."
    try:
        owner = Owner.model_validate_json(content)
    except ValidationError as error:
        raise OtherOwnerError(unknown) from error
    if not (_is_name(owner.campaign) and _is_name(owner.uid)):  # folders are called so
        raise OtherOwnerError(unknown)
    return owner


def _is_name(text: str) -> bool:
    """Whether a text can be a file name and is not a path."""
    return PurePosixPath(text).name == text and text not in {"", ".."} and "\0" not in text


def claim(store: ObjectStore, bucket: str, owner: Owner) -> None:
    """Create a bucket and record its owner; do nothing if it has this owner already.

    Raises:
        OtherOwnerError: it belongs to another campaign.
        StorageError: it cannot be created, read or written.
    """
    if not is_owned(store, bucket, owner.uid):
        store.make_bucket(bucket)
        if not store.create(bucket, OWNER, owner.model_dump_json().encode()):
            is_owned(store, bucket, owner.uid)


def is_owned(store: ObjectStore, bucket: str, uid: str) -> bool:
    """True if a bucket belongs to the Campaign, False if it has no owner.

    Args:
        store: the S3 server.
        bucket: its name.
        uid: uid of the Campaign.

    Raises:
        OtherOwnerError: it belongs to another campaign.
        StorageError: it cannot be read.
    """
    found = owner_of(store, bucket)
    if found is not None and found.uid != uid:
        raise OtherOwnerError(
            f"the bucket {bucket} belongs to {found}, not to the one with the uid {uid}. Its "
            "contents are neither read nor changed for another Campaign",
            hint="give this Campaign a bucket of its own: another name, or another "
            "`spec.storage.prefix`",
        )
    return found is not None

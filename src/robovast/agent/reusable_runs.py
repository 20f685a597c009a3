"""Where a run with a key is stored: an object for each key, in a bucket that campaigns share.

A run is looked up by name, so that neither buckets nor campaigns are listed. Whoever empties the
bucket loses no result. Anybody may have written an offer: what it leads to is checked.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from robovast.base.errors import StorageError
from robovast.base.printable import printable
from robovast.campaign.layout import is_variant
from robovast.campaign.object_keys import run_of
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.storage.bucket_names import REUSE_BUCKET
from robovast.storage.s3 import ObjectStore
from robovast.storage.s3_errors import ObjectError

LARGEST = 1 << 14
"""Largest offer [byte]."""


class StorageOffer(BaseModel):
    """Where a run is stored."""

    model_config = ConfigDict(extra="ignore", frozen=True, defer_build=True)

    bucket: str = Field(pattern="^[a-z0-9][a-z0-9-]{1,61}[a-z0-9]$")
    run: str
    """`<variant>/<number>`."""

    @field_validator("run")
    @classmethod
    def _check_run(cls, run: str) -> str:
        if run_of(f"{run}/") != run or not is_variant(run.partition("/")[0]):
            raise ValueError("is not a run")
        return run


def is_result(record: RunRecord) -> bool:
    """Whether a run can stand for another one: it has a verdict, and all of its files."""
    known = record.verdict in (Verdict.PASSED, Verdict.FAILED)
    return bool(record.key) and known and record.outputs is not None


def make_offer(store: ObjectStore, bucket: str, record: RunRecord) -> None:
    """Let other campaigns find a run that is stored in a bucket, if it is a result.

    The run is stored, whatever becomes of the offer: a quota, or a bucket that was removed, costs
    others their time alone.
    """
    if not is_result(record):
        return
    place = StorageOffer(bucket=bucket, run=f"{record.variant}/{record.run}")
    try:
        store.put_bytes(REUSE_BUCKET, record.key, place.model_dump_json().encode())
    except StorageError as error:
        print(printable(f"{place.run} is not offered to others: {error}"))  # noqa: T201


def find_offer(store: ObjectStore, key: str) -> StorageOffer | None:
    """Where a run with a key is stored; None if nobody has offered one.

    Raises:
        ObjectError: the offer is none.
        StorageError: the storage refuses, or is gone for too long.
    """
    content = store.read(REUSE_BUCKET, key, LARGEST)
    try:
        return None if content is None else StorageOffer.model_validate_json(content)
    except ValidationError as error:
        raise ObjectError(f"{REUSE_BUCKET}/{key} is damaged: {error}") from None

"""A bucket is removed only if it names the Campaign as its owner, whatever a plan says."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.agent.bucket import Bucket
from robovast.model.packs import Owner
from robovast.storage.bucket_ownership import OWNER, OtherOwnerError


def owner(uid: str) -> Owner:
    return Owner(uid=uid, namespace="lab", name="drive", campaign="drive-2026")


class Store:
    """Buckets in memory; a removal may be interrupted."""

    def __init__(self, **buckets: dict[str, bytes]) -> None:
        self.made = buckets
        self.left: int | None = None
        """How many objects are removed before an interruption."""

    def read(self, bucket: str, key: str, _: int) -> bytes | None:
        return self.made.get(bucket, {}).get(key)

    def has_bucket(self, bucket: str) -> bool:
        return bucket in self.made

    def objects(self, bucket: str) -> list[str]:
        return list(self.made[bucket])

    def delete_bucket(self, bucket: str, *, last: str, content: bool) -> None:
        keys = self.made.get(bucket, {})
        assert content or not keys, "the server refuses this"
        for key in [*(key for key in sorted(keys) if key != last), *{last} & keys.keys()]:
            if self.left == 0:
                raise OSError("no server")
            self.left = None if self.left is None else self.left - 1
            del keys[key]
        self.made.pop(bucket, None)


RECORDS = st.sampled_from(["mine", "theirs", "", None])


@given(RECORDS, st.sets(st.sampled_from(["_config/a", "one-1/0/run.json"])), st.booleans())
def test_only_the_owner_that_a_bucket_names_may_remove_it(
    record: str | None, keys: set[str], other: bool
) -> None:
    """`theirs` belongs to another Campaign, an empty record cannot be read, None names nobody."""
    content = dict.fromkeys(keys, b"x")
    if record is not None:
        content[OWNER] = owner(record).model_dump_json().encode() if record else b"{"
    store: Any = Store(results=dict(content), **({"other": {"a": b""}} if other else {}))
    bucket = Bucket(store, "results", owner("mine"))
    if record == "mine" or not content:
        bucket.remove()
        bucket.remove()
        assert "results" not in store.made
    else:
        with pytest.raises(OtherOwnerError):
            bucket.remove()
        assert store.made["results"] == content
    assert ("other" in store.made) == other


@given(st.integers(0, 3), st.sets(st.sampled_from(["_config/a", "one-1/0/run.json", "~"])))
def test_a_removal_that_was_interrupted_is_continued(left: int, keys: set[str]) -> None:
    """The owner goes last, so what is left still names it."""
    mine = owner("mine").model_dump_json().encode()
    store: Any = Store(results={**dict.fromkeys(keys, b"x"), OWNER: mine})
    bucket = Bucket(store, "results", owner("mine"))
    store.left = left
    if left <= len(keys):
        with pytest.raises(OSError, match="no server"):
            bucket.remove()
        assert OWNER in store.made["results"]
    store.left = None
    bucket.remove()
    assert not store.made

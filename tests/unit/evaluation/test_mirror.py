"""The web UI of a cluster mirrors as many campaigns as fit, the newest first."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.base.errors import InputError
from robovast.campaign.object_keys import OMITTED
from robovast.evaluation import mirror as mirror_module
from robovast.evaluation.library import Library
from robovast.evaluation.mirror import fitting, in_bytes, mirror
from robovast.model.packs import Owner
from robovast.storage.s3 import StoredObject

SIZES = st.lists(st.integers(0, 100), max_size=20)


@given(SIZES, st.integers(0, 300))
def test_the_newest_campaigns_fit_and_never_more_than_the_room(sizes: list[int], room: int) -> None:
    fits = fitting(sizes, room)
    assert len(fits) == len(sizes)
    assert sum(size for size, fit in zip(sizes, fits, strict=True) if fit) <= room
    for number, (size, fit) in enumerate(zip(sizes, fits, strict=True)):
        newer = sum(s for s, f in zip(sizes[:number], fits[:number], strict=True) if f)
        assert fit == (newer + size <= room)


@pytest.mark.parametrize(
    ("amount", "size"),
    [("20Gi", 20 * 2**30), ("1.5G", 1.5e9), ("500k", 5e5), ("8Ki", 8192), ("1e3", 1000), ("7", 7)],
)
def test_amounts_are_those_of_kubernetes(amount: str, size: float) -> None:
    assert in_bytes(amount) == size


@pytest.mark.parametrize("amount", ["", "Gi", "20 Gi", "20gi", "-1Gi", "i", "20i"])
def test_others_are_refused(amount: str) -> None:
    with pytest.raises(ValueError, match="is not a valid size"):
        in_bytes(amount)


class Store:
    """Buckets of some sizes, by the name of their campaign."""

    def __init__(self, **sizes: int) -> None:
        self.sizes = {f"c-2026-03-0{day[1:]}-121530": size for day, size in sizes.items()}

    def buckets(self) -> list[str]:
        return list(self.sizes)

    def has_bucket(self, bucket: str) -> bool:
        return bucket in self.sizes

    def objects(self, bucket: str) -> list[StoredObject]:
        return [StoredObject("_config/a.vast", self.sizes[bucket], 0.0, "")]


def test_campaigns_without_room_are_left_out_with_a_reason_until_there_is_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def owner_of(_: object, bucket: str) -> Owner:
        return Owner(uid=bucket, namespace="n", name="c", campaign=bucket)

    def download(_: object, bucket: str, folder: Path, __: object) -> Any:
        (folder / "_config").mkdir(parents=True, exist_ok=True)
        (folder / "_config" / "a.vast").write_text(bucket)
        (folder / "_transient").mkdir(exist_ok=True)
        owner = owner_of(None, bucket).model_dump_json()
        (folder / "_transient" / "owner.json").write_text(owner)
        return type("Result", (), {"warnings": ()})

    monkeypatch.setattr(mirror_module, "owner_of", owner_of)
    monkeypatch.setattr(mirror_module, "download_campaign", download)
    (tmp_path / "mine-2026-01-01-000000" / "_config").mkdir(parents=True)

    def shown(store: Store, room: float) -> set[int]:
        assert mirror(store, tmp_path, room) == []  # type: ignore[arg-type]
        return {int(path.parents[1].name[11]) for path in tmp_path.glob("c-*/_config/a.vast")}

    store: Any = Store(d1=50, d2=40, d3=30)
    assert shown(store, 70) == {3, 2}
    library = Library(tmp_path)
    assert "c-2026-03-01-121530" in library.names(), "what is left out is listed"
    with pytest.raises(InputError, match=r"is not shown.*page\.size"):
        library.summary("c-2026-03-01-121530")
    store.sizes["c-2026-03-04-121530"] = 60
    assert shown(store, 70) == {4}
    assert shown(store, 110) == {4, 2} or shown(store, 110) == {4, 3}
    del store.sizes["c-2026-03-04-121530"]
    assert shown(store, 1000) == {1, 2, 3}
    assert not list(tmp_path.glob(f"*/{OMITTED}"))
    assert (tmp_path / "mine-2026-01-01-000000").exists()


def test_a_reason_that_is_no_text_harms_only_its_campaign(tmp_path: Path) -> None:
    folder = tmp_path / "c-2026-03-01-121530"
    (folder / "_config").mkdir(parents=True)
    (folder / "_config/a.vast").touch()
    (folder / OMITTED).write_bytes(b"\xff\xfe")
    with pytest.raises(InputError):
        Library(tmp_path).summary(folder.name)

"""The publication plugin `s3` on real servers: everything arrives once; faults are explained."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

import pytest
from robovast_testbed.s3 import Server

from robovast.analysis.publication.context import PublicationCampaign, PublicationContext
from robovast.analysis.publication.s3 import S3Upload
from robovast.base.errors import InputError, StorageError
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.s3 import ObjectStore

NAME = "a b-2026-01-01-000000"


@pytest.fixture
def store(s3_server: Server) -> ObjectStore:
    credentials = Credentials(s3_server.access_key, s3_server.secret_key)
    return ObjectStore(Endpoint.parse(f"http://{s3_server.endpoint}"), credentials)


@pytest.fixture
def bucket(store: ObjectStore, s3_server: Server, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.setenv("ROBOVAST_S3_ACCESS_KEY", s3_server.access_key)
    monkeypatch.setenv("ROBOVAST_S3_SECRET_KEY", s3_server.secret_key)
    name = f"test-{uuid4().hex[:12]}"
    yield name
    store.delete_bucket(name)


@pytest.fixture
def context(tmp_path: Path) -> PublicationContext:
    run = tmp_path / NAME / "one" / "0"
    run.mkdir(parents=True)
    (run / "out.csv").write_text("1,2\n")
    (run / "job").symlink_to("out.csv")
    (tmp_path / f"{NAME}.zip").write_bytes(b"zip" * 1000)
    return PublicationContext(
        (PublicationCampaign(tmp_path / NAME, {}),), (tmp_path / f"{NAME}.zip",)
    )


def test_archives_are_uploaded_once(
    s3_server: Server, store: ObjectStore, bucket: str, context: PublicationContext
) -> None:
    where = {"bucket": bucket, "endpoint": f"http://{s3_server.endpoint}", "prefix": "a/b-"}
    seen: list[tuple[int, int]] = []
    context = PublicationContext(
        context.campaigns, context.files, progress=lambda _, *step: seen.append(step)
    )
    for said in ("1 files sent", "0 files sent"):
        good, message = S3Upload()("", "", **where, context=context)
        assert good
        assert message.startswith(said)
    assert store.read(bucket, f"a/b-{NAME}.zip") == b"zip" * 1000
    assert seen == [(1, 1), (1, 1)]


def test_campaigns_can_be_uploaded_file_by_file(
    s3_server: Server, store: ObjectStore, bucket: str, context: PublicationContext
) -> None:
    address = f"http://{s3_server.endpoint}"
    S3Upload()("", "", bucket, endpoint=address, unpacked=True, context=context)
    assert [item.key for item in store.objects(bucket)] == [f"{NAME}/one/0/out.csv"]


def test_what_is_wrong_is_explained(
    s3_server: Server,
    bucket: str,
    context: PublicationContext,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    address = f"http://{s3_server.endpoint}"
    with pytest.raises(InputError, match="nothing to upload to S3"):
        S3Upload()("", "", bucket, endpoint=address, context=PublicationContext(context.campaigns))
    monkeypatch.setenv("ROBOVAST_S3_SECRET_KEY", "wrong-secret-5d1")
    with pytest.raises(StorageError, match="cannot create the bucket") as caught:
        S3Upload()("", "", bucket, endpoint=address, context=context)
    assert "wrong-secret-5d1" not in str(caught.value)
    monkeypatch.delenv("ROBOVAST_S3_SECRET_KEY")
    with pytest.raises(InputError, match="ROBOVAST_S3_SECRET_KEY"):
        S3Upload()("", "", bucket, endpoint=address, context=context)

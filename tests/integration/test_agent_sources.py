"""Where pods get a document's files from: an archive in S3, a Git repository."""

from __future__ import annotations

import hashlib
import io
import subprocess
import tarfile
from collections.abc import Callable, Iterator
from pathlib import Path
from uuid import uuid4

import pytest
from robovast_testbed.s3 import Server

from robovast.agent.folders import Folders
from robovast.agent.sources import copy_inputs
from robovast.cluster.endpoint import Credentials, Endpoint
from robovast.cluster.plan import Bundle, CampaignPlan, GitSource
from robovast.cluster.storage import ObjectStore
from robovast.errors import InputError, RobovastError, StorageError

pytestmark = pytest.mark.parametrize("s3_server", ["minio"], indirect=True)

Copy = Callable[..., Path]


@pytest.fixture
def store(s3_server: Server) -> ObjectStore:
    keys = Credentials(s3_server.access_key, s3_server.secret_key)
    return ObjectStore(Endpoint.parse(f"http://{s3_server.endpoint}"), keys)


@pytest.fixture
def copy(store: ObjectStore, tmp_path: Path) -> Copy:
    """Copies what a plan says into a folder."""

    def copy(**source: object) -> Path:
        plan = CampaignPlan(
            campaign="c", bucket="b", endpoint="http://s3", document="test.vast",
            expansion="pure", runs=1, image="i", **source,
        )  # fmt: skip
        target = tmp_path / "inputs"
        target.mkdir()
        copy_inputs(plan, Folders(work=tmp_path / "work"), store, target)
        return target

    return copy


def archive(name: str, mode: int = 0o644) -> bytes:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:gz") as file:
        entry = tarfile.TarInfo(name)
        entry.size, entry.mode = 5, mode
        file.addfile(entry, io.BytesIO(b"hello"))
    return buffer.getvalue()


@pytest.fixture
def bundle(store: ObjectStore) -> Iterator[Callable[[bytes], Bundle]]:
    bucket = f"bundles-{uuid4().hex[:8]}"
    store.make_bucket(bucket)

    def put(content: bytes) -> Bundle:
        store.put_bytes(bucket, "files.tar.gz", content)
        digest = hashlib.sha256(content).hexdigest()
        return Bundle(bucket=bucket, key="files.tar.gz", sha256=digest)

    yield put
    store.delete_bucket(bucket)


def test_an_archive_is_unpacked_with_its_modes(
    copy: Copy, bundle: Callable[[bytes], Bundle]
) -> None:
    folder = copy(bundle=bundle(archive("files/post.sh", 0o755)))
    assert (folder / "files/post.sh").read_text() == "hello"
    assert (folder / "files/post.sh").stat().st_mode & 0o100


def test_an_archive_of_other_content_is_refused(
    copy: Copy, bundle: Callable[[bytes], Bundle]
) -> None:
    wanted = bundle(archive("a"))
    bundle(archive("b"))
    with pytest.raises(InputError, match="SHA-256"):
        copy(bundle=wanted)


def test_a_missing_archive_is_named(copy: Copy, bundle: Callable[[bytes], Bundle]) -> None:
    made = bundle(archive("a"))
    with pytest.raises(InputError, match=r"none\.tar\.gz, does not exist"):
        copy(bundle=made.model_copy(update={"key": "none.tar.gz"}))


@pytest.mark.parametrize("content", [archive("../outside"), b"no archive"])
def test_an_archive_that_cannot_be_trusted_is_refused(
    copy: Copy, bundle: Callable[[bytes], Bundle], content: bytes, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="cannot be unpacked"):
        copy(bundle=bundle(content))
    assert not (tmp_path / "outside").exists()


@pytest.fixture
def repository(tmp_path: Path) -> str:
    folder = tmp_path / "repository"
    (folder / "sim/files").mkdir(parents=True)
    (folder / "sim/files/step.sh").write_text("echo\n")
    for command in (
        ("init", "--quiet", "--initial-branch=main"),
        ("add", "."),
        ("-c", "user.name=a", "-c", "user.email=a@b", "commit", "--quiet", "--message=first"),
    ):
        subprocess.run(["git", *command], cwd=folder, check=True)
    return f"file://{folder}"


def test_a_folder_of_a_repository(copy: Copy, repository: str) -> None:
    folder = copy(git=GitSource(url=repository, ref="main", path="sim"))
    assert {path.relative_to(folder).as_posix() for path in folder.rglob("*")} == {
        "files", "files/step.sh",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("changed", "kind", "told"),
    [
        ({"ref": "none"}, StorageError, "none"),
        ({"path": "nowhere"}, InputError, "nowhere"),
        ({"path": ".."}, InputError, "has no folder"),
    ],
)
def test_what_a_repository_does_not_have_is_named(
    copy: Copy, repository: str, changed: dict[str, str], kind: type[RobovastError], told: str
) -> None:
    with pytest.raises(kind, match=told):
        copy(git=GitSource(**{"url": repository, "ref": "main", **changed}))

"""Where pods get a document's files from: an archive in S3, a Git repository."""

from __future__ import annotations

import hashlib
import io
import subprocess
import tarfile
from base64 import b64encode
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import ClassVar
from uuid import uuid4

import pytest
from robovast_testbed.s3 import Server
from support.campaigns.owner import OWNER

from robovast.agent.mounts import Folders
from robovast.agent.sources import copy_inputs
from robovast.base.errors import InputError, RobovastError, StorageError
from robovast.model.packs import Bundle, CampaignPlan, GitSource
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.s3 import ObjectStore

pytestmark = pytest.mark.parametrize("s3_server", ["minio"], indirect=True)

Copy = Callable[..., Path]


@pytest.fixture
def store(s3_server: Server) -> ObjectStore:
    keys = Credentials(s3_server.access_key, s3_server.secret_key)
    return ObjectStore(Endpoint.parse(f"http://{s3_server.endpoint}"), keys)


@pytest.fixture
def copy(store: ObjectStore, tmp_path: Path) -> Copy:
    """Copies what a plan says into a folder."""

    def copy(folder: Path = tmp_path / "none", **source: object) -> Path:
        plan = CampaignPlan(
            campaign="c", bucket="b", owner=OWNER, seed=7, document="test.vast",
            expansion="pure", runs=1, image="i", **source,
        )  # fmt: skip
        target = tmp_path / "inputs"
        target.mkdir()
        copy_inputs(plan, Folders(work=tmp_path / "work", git=folder), store, target)
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


def commit(repository: str) -> None:
    folder = repository.removeprefix("file://")
    for command in (
        ("add", "."),
        ("-c", "user.name=a", "-c", "user.email=a@b", "commit", "--quiet", "--message=more"),
    ):
        subprocess.run(["git", *command], cwd=folder, check=True)


@pytest.mark.parametrize(
    ("path", "link", "leads_to"),
    [
        ("sim", "sim/map.png", "/robovast/credentials/secretKey"),
        ("sim", "sim/map.png", "../../../credentials/secretKey"),
        ("sim", "sim/map.png", "../.git/config"),
        ("sim", "sim/maps", ".."),
        ("sim", "sim/map.png", "files/next"),  # a link to the next one, which leads out
        ("sim/files", "sim/files/map.png", "../../credentials/secretKey"),
    ],
)
def test_a_link_that_leaves_a_checkout_is_refused_by_name(
    copy: Copy, repository: str, tmp_path: Path, path: str, link: str, leads_to: str
) -> None:
    top = Path(repository.removeprefix("file://"))
    if leads_to.endswith("next"):
        (top / "sim/files/next").symlink_to("/etc/hostname")
    (top / link).symlink_to(leads_to)
    commit(repository)
    with pytest.raises(InputError, match=r"(map|next).*is a link that leads out"):
        copy(git=GitSource(url=repository, ref="main", path=path))
    assert not list((tmp_path / "inputs").rglob("map.png"))


def test_a_folder_that_is_a_link_out_of_a_checkout_is_none_of_it(
    copy: Copy, repository: str, tmp_path: Path
) -> None:
    secrets = tmp_path / "credentials"
    secrets.mkdir()
    (secrets / "secretKey").write_text("secret")
    (Path(repository.removeprefix("file://")) / "away").symlink_to(secrets)
    commit(repository)
    with pytest.raises(InputError, match="has no folder `away`"):
        copy(git=GitSource(url=repository, ref="main", path="away"))
    assert not list((tmp_path / "inputs").iterdir())


def test_links_within_a_checkout_are_its_files(copy: Copy, repository: str) -> None:
    top = Path(repository.removeprefix("file://"))
    (top / "shared").mkdir()
    (top / "shared/map.png").write_text("map")
    (top / "sim/map.png").symlink_to("../shared/map.png")
    (top / "sim/same").symlink_to("files")
    commit(repository)
    folder = copy(git=GitSource(url=repository, ref="main", path="sim"))
    assert (folder / "map.png").read_text() == "map"
    assert not (folder / "map.png").is_symlink()
    assert (folder / "same/step.sh").read_text() == "echo\n"


def test_an_archive_with_a_link_that_leaves_it_is_refused(copy: Copy, store: ObjectStore) -> None:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:gz") as file:
        entry = tarfile.TarInfo("map.png")
        entry.type, entry.linkname = tarfile.SYMTYPE, "../../../credentials/secretKey"
        file.addfile(entry)
    content, bucket = buffer.getvalue(), f"bundles-{uuid4().hex[:12]}"
    store.make_bucket(bucket)
    store.put_bytes(bucket, "a.tar.gz", content)
    digest = hashlib.sha256(content).hexdigest()
    with pytest.raises(InputError, match=r"map\.png"):
        copy(bundle=Bundle(bucket=bucket, key="a.tar.gz", sha256=digest))
    store.delete_bucket(bucket)


class PrivateServer(BaseHTTPRequestHandler):
    """A Git server, to the only account of which it says that there is no repository."""

    asked: ClassVar[list[str]] = []

    def do_GET(self) -> None:
        granted = self.headers.get("Authorization", "")
        self.asked.append(granted)
        self.send_response(404 if granted else 401)
        self.send_header("WWW-Authenticate", 'Basic realm="git"')
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@pytest.fixture
def private() -> Iterator[str]:
    """Host and port of a Git server that wants to know who asks."""
    PrivateServer.asked.clear()
    with ThreadingHTTPServer(("127.0.0.1", 0), PrivateServer) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"127.0.0.1:{server.server_port}"
        server.shutdown()


def test_whoever_a_url_names_stands_in_no_message(copy: Copy, private: str) -> None:
    source = GitSource(url=f"http://bot:ghp_SECRET@{private}/a.git", ref="main")
    with pytest.raises(StorageError) as told:
        copy(git=source)
    assert f"http://{private}/a.git" in str(told.value)
    assert "bot" not in str(told.value)
    assert "ghp_SECRET" not in str(told.value)


def test_an_account_from_a_secret_is_shown_to_its_server_alone(
    copy: Copy, private: str, tmp_path: Path
) -> None:
    git = tmp_path / "git"
    git.mkdir()
    (git / "username").write_text("bot")
    (git / "password").write_text("ghp_SECRET'\"$x\n")
    with pytest.raises(StorageError):
        copy(git=GitSource(url=f"http://{private}/a.git", ref="main"), folder=git)
    assert b64encode(b"bot:ghp_SECRET'\"$x").decode() in PrivateServer.asked[-1]

"""Shares on real servers: archives come and go as they are, over cuts; faults are explained."""

from __future__ import annotations

import io
import json
import os
import resource
import subprocess
import tarfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import pytest
from google.auth.credentials import AnonymousCredentials
from support.faults.small_disk import small_disk
from support.servers.gcs_gate import Gate
from support.servers.page import VAST
from support.servers.share_places import Place, gcs, sftp, webdav
from support.servers.shares import PASSWORD, USER, webdav_process

from robovast.base.errors import InputError, RobovastError, StorageError
from robovast.storage.shares import gcs as gcs_module
from robovast.storage.shares import sftp as sftp_module
from robovast.storage.shares.campaigns import FETCHED, Share, download_from_share, open_share

MIB = 2**20
NAME = "my camp-2026-03-05-121530"
ARCHIVE = f"{NAME}.tar.gz"


@pytest.fixture(autouse=True)
def own_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in os.environ:
        if name.startswith(("ROBOVAST_", "GOOGLE_", gcs_module.EMULATOR)):
            monkeypatch.delenv(name)
    (tmp_path / "project").mkdir()
    monkeypatch.chdir(tmp_path / "project")
    monkeypatch.setenv("HOME", str(tmp_path))


@pytest.fixture(scope="session")
def service_account() -> str:
    from cryptography.hazmat.primitives import serialization
    from cryptography.hazmat.primitives.asymmetric import rsa

    key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    return key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    ).decode()


KINDS = ("webdav", "nextcloud", "sftp", "gcs")


@pytest.fixture(scope="session", params=KINDS)
def share_type(request: pytest.FixtureRequest) -> str:
    """A type whose server can be had; one that must be built is built in the user's environment."""
    if request.param == "gcs":
        request.getfixturevalue("gcs_server")
    return str(request.param)


@pytest.fixture
def place(
    share_type: str,
    request: pytest.FixtureRequest,
    tmp_path: Path,
    service_account: str,
    monkeypatch: pytest.MonkeyPatch,
) -> Iterator[Place]:
    with ExitStack() as stack:
        (tmp_path / "server").mkdir()
        if share_type == "gcs":
            monkeypatch.setattr(gcs_module, "PART", MIB)
            yield gcs(stack, request.getfixturevalue("gcs_server"), service_account)[0]
        elif share_type == "sftp":
            yield sftp(stack, tmp_path / "server", share_type)
        else:
            yield webdav(stack, tmp_path / "server", share_type)


@pytest.fixture
def share(place: Place) -> Iterator[Share]:
    lines = [f"{name}='{value}'" for name, value in place.env.items()]
    Path("..", ".env").write_text("\n".join([*lines, f"ROBOVAST_SHARE_TYPE={place.kind}", ""]))
    with open_share() as opened:
        yield opened


def archive(folder: Path, size: int = MIB) -> Path:
    """A campaign's archive."""
    path = folder / ARCHIVE
    with tarfile.open(path, "w:gz") as tar:
        for name, content in {"_config/x.vast": b"", "one/0/out": os.urandom(size)}.items():
            info = tarfile.TarInfo(f"{NAME}/{name}")
            info.size = len(content)
            tar.addfile(info, io.BytesIO(content))
    return path


def put(share: Share, path: Path) -> None:
    share.provider.upload_archive(str(path), path.name)


def test_an_archive_comes_home_as_it_was(share: Share, place: Place, tmp_path: Path) -> None:
    path = archive(tmp_path)
    sent: list[tuple[int, int]] = []
    share.provider.verify_access()
    share.provider.upload_archive(str(path), path.name, lambda *step: sent.append(step))
    assert place.names() == {ARCHIVE}
    assert place.content(ARCHIVE) == path.read_bytes()
    assert [(item.name, item.size) for item in share.campaigns()] == [(NAME, path.stat().st_size)]
    seen: list[tuple[str, int, int]] = []
    fetched, present = download_from_share(
        share, [], tmp_path / "home", progress=lambda *step: seen.append(step)
    )
    assert (fetched, present) == ([tmp_path / "home" / NAME], [])
    assert (fetched[0] / "one" / "0" / "out").stat().st_size == MIB
    assert [path.name for path in (tmp_path / "home").iterdir()] == [NAME]
    size = path.stat().st_size
    assert seen[-1] == (NAME, size, size)
    assert sent[-1] == (size, size)


def test_a_full_disk_here_is_no_fault_of_the_share(
    share: Share, place: Place, tmp_path: Path
) -> None:
    put(share, archive(tmp_path))
    started = time.monotonic()
    with small_disk(MIB // 2), pytest.raises(StorageError, match="cannot be written: File too la"):
        download_from_share(share, [NAME], tmp_path / "home")
    assert time.monotonic() - started < 100, "trying again frees no space"
    assert not (tmp_path / "home" / NAME).exists()


def test_what_is_here_is_not_fetched_again(share: Share, place: Place, tmp_path: Path) -> None:
    put(share, archive(tmp_path, 1000))
    download_from_share(share, [NAME], tmp_path / "home", keep_archive=True)
    assert (tmp_path / "home" / ARCHIVE).read_bytes() == place.content(ARCHIVE)
    assert download_from_share(share, [], tmp_path / "home") == ([], [tmp_path / "home" / NAME])
    fetched, _ = download_from_share(share, [ARCHIVE], tmp_path / "home", force=True)
    assert fetched == [tmp_path / "home" / NAME]


def test_an_archive_of_the_user_stays(share: Share, place: Place, tmp_path: Path) -> None:
    put(share, archive(tmp_path, 1000))
    home = tmp_path / "home"
    home.mkdir()
    (home / ARCHIVE).write_text("the user's own")
    with pytest.raises(InputError, match=r"exists already\. Move it away"):
        download_from_share(share, [], home, keep_archive=True)
    assert [path.name for path in home.iterdir()] == [ARCHIVE]
    download_from_share(share, [], home)
    assert (home / ARCHIVE).read_text() == "the user's own"
    assert {path.name for path in home.iterdir()} == {ARCHIVE, NAME}
    download_from_share(share, [], home, force=True, keep_archive=True)
    assert (home / ARCHIVE).read_bytes() == place.content(ARCHIVE)
    assert {path.name for path in home.iterdir()} == {ARCHIVE, NAME}


def test_an_archive_is_replaced_and_removed(share: Share, place: Place, tmp_path: Path) -> None:
    put(share, archive(tmp_path, 1000))
    path = archive(tmp_path, 2000)
    put(share, path)
    assert place.content(ARCHIVE) == path.read_bytes()
    assert share.provider.archive_exists_on_share(ARCHIVE)
    share.remove(share.chosen([NAME])[0])
    assert place.names() == set()
    assert not share.provider.archive_exists_on_share(ARCHIVE)
    with pytest.raises(InputError, match=r"no campaign `my camp.*Upload a campaign"):
        share.chosen([NAME])
    with pytest.raises(InputError, match=r"there is no"):
        share.provider.remove_archive(ARCHIVE)


def test_only_archives_are_listed(share: Share, place: Place, tmp_path: Path) -> None:
    for name in ("b.tar.gz", "a.tar.gz", "notes.txt"):
        path = tmp_path / name
        path.write_text(name)
        put(share, path)
    assert [item.archive for item in share.campaigns()] == ["a.tar.gz", "b.tar.gz"]


def test_a_cut_in_an_upload_costs_an_attempt(share: Share, place: Place, tmp_path: Path) -> None:
    path = archive(tmp_path, 4 * MIB)
    share.campaigns()
    place.proxy.cut_once(sent=2 * MIB)
    put(share, path)
    assert place.proxy.cuts == 1
    assert place.names() == {ARCHIVE}
    assert place.content(ARCHIVE) == path.read_bytes()


def test_a_cut_in_a_download_costs_an_attempt(share: Share, place: Place, tmp_path: Path) -> None:
    put(share, archive(tmp_path, 4 * MIB))
    place.proxy.cut_once(received=2 * MIB)
    fetched, _ = download_from_share(share, [], tmp_path / "home")
    assert place.proxy.cuts == 1
    assert (fetched[0] / "one" / "0" / "out").stat().st_size == 4 * MIB


def test_an_interrupted_download_is_resumed(share: Share, place: Place, tmp_path: Path) -> None:
    put(share, archive(tmp_path, 4 * MIB))

    def interrupt(name: str, done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        download_from_share(share, [], tmp_path / "home", progress=interrupt)
    (part,) = (tmp_path / "home" / FETCHED).iterdir()
    here = part.stat().st_size
    assert 0 < here < 4 * MIB
    seen: list[int] = []
    fetched, _ = download_from_share(
        share, [], tmp_path / "home", progress=lambda _, done, __: seen.append(done)
    )
    assert min(seen) > here
    assert (fetched[0] / "one" / "0" / "out").stat().st_size == 4 * MIB


def test_no_credential_is_in_a_message(
    share: Share, place: Place, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ("ROBOVAST_WEBDAV_PASSWORD", "ROBOVAST_SFTP_PASSWORD", "ROBOVAST_SHARE_URL")
    for name in names:
        if name in place.env:
            monkeypatch.setenv(name, place.env[name].replace("AbC", "other") + "wrong")
    if place.kind == "gcs":
        key = json.loads(place.env["ROBOVAST_GCS_KEY_JSON"])
        monkeypatch.setenv("ROBOVAST_GCS_KEY_JSON", json.dumps({**key, "private_key": "damaged"}))
    with open_share() as wrong, pytest.raises(RobovastError) as caught:
        wrong.provider.verify_access()
    assert "Check " in str(caught.value) or "damaged" in str(caught.value)
    assert not [secret for secret in place.secrets if secret in str(caught.value)]


def test_a_pod_needs_only_what_the_provider_gives_it(
    share: Share, place: Place, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    env = share.provider.build_pod_env()
    for name in place.env:
        monkeypatch.delenv(name, raising=False)
    for name, value in env.items():
        monkeypatch.setenv(name, value)
    type(share.provider)().verify_access()


def test_several_check_their_access_at_once(share: Share, place: Place) -> None:
    """The user's machine and pods, whose process ids are the same, use one folder."""
    with ThreadPoolExecutor(4) as threads:
        checks = [threads.submit(type(share.provider)().verify_access) for _ in range(24)]
    assert [check.exception() for check in checks if check.exception()] == []
    assert place.names() == set()


def test_a_server_that_is_not_there_is_told_soon(
    share: Share, place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    from robovast.storage import http_client

    for module in (http_client, gcs_module):
        monkeypatch.setattr(module, "FIRST_CONTACT", 0.1)
    place.proxy.close()
    with (
        open_share() as other,
        pytest.raises(StorageError, match="Check the address"),
    ):
        other.campaigns()


class TestWebDav:
    @pytest.fixture
    def kind(self) -> str:
        return "webdav"

    def test_a_folder_that_is_missing_is_explained(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with ExitStack() as stack:
            place = webdav(stack, tmp_path / "server", "webdav")
            for name, value in place.env.items():
                monkeypatch.setenv(name, value)
            monkeypatch.setenv("ROBOVAST_SHARE_TYPE", "webdav")
            monkeypatch.setenv("ROBOVAST_WEBDAV_URL", f"http://{place.proxy.address}/other")
            with open_share() as share:
                with pytest.raises(StorageError, match=r"404.*Check ROBOVAST_WEBDAV_URL"):
                    share.campaigns()
                with pytest.raises(StorageError, match=r"409.*Check ROBOVAST_WEBDAV_URL"):
                    share.provider.verify_access()

    def test_a_share_that_is_full_keeps_no_half_archive(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        served = tmp_path / "served"
        served.mkdir()
        with webdav_process(served) as (server, address):
            _, most = resource.prlimit(server.pid, resource.RLIMIT_FSIZE)
            resource.prlimit(server.pid, resource.RLIMIT_FSIZE, (MIB, most))
            monkeypatch.setenv("ROBOVAST_SHARE_TYPE", "webdav")
            monkeypatch.setenv("ROBOVAST_WEBDAV_URL", f"http://{address}")
            monkeypatch.setenv("ROBOVAST_WEBDAV_USER", USER)
            monkeypatch.setenv("ROBOVAST_WEBDAV_PASSWORD", PASSWORD)
            with open_share() as share:
                share.verify()
                share.provider._client._patience = 0.1  # type: ignore[attr-defined]
                with pytest.raises(StorageError, match=f"cannot upload {ARCHIVE} "):
                    share.put(archive(tmp_path, 4 * MIB), lambda _done, _total: None)
                assert list(served.iterdir()) == []
                share.put(archive(tmp_path, 1000), lambda _done, _total: None)
        assert [path.name for path in served.iterdir()] == [ARCHIVE]


class TestSftp:
    @pytest.fixture
    def place(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Place]:
        (tmp_path / "server").mkdir()
        with ExitStack() as stack:
            place = sftp(stack, tmp_path / "server", "sftp")
            for name, value in place.env.items():
                monkeypatch.setenv(name, value)
            monkeypatch.setenv("ROBOVAST_SHARE_TYPE", "sftp")
            yield place

    def test_a_server_of_unknown_identity_gets_no_password(
        self, place: Place, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.delenv("ROBOVAST_SFTP_HOST_KEY")
        with open_share() as share, pytest.raises(InputError, match="is not known: its key") as e:
            share.campaigns()
        assert place.env["ROBOVAST_SFTP_HOST_KEY"].split()[1] in str(e.value)
        monkeypatch.setenv("ROBOVAST_INSECURE_SSL", "1")
        with open_share() as share:
            assert share.campaigns() == []

    def test_known_hosts_count_and_reach_a_pod(
        self, place: Place, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
    ) -> None:
        monkeypatch.delenv("ROBOVAST_SFTP_HOST_KEY")
        (tmp_path / ".ssh").mkdir()
        key, port = place.env["ROBOVAST_SFTP_HOST_KEY"], place.env["ROBOVAST_SFTP_PORT"]
        (tmp_path / ".ssh" / "known_hosts").write_text(f"[127.0.0.1]:{port} {key}\n")
        with open_share() as share:
            assert share.campaigns() == []
            assert (
                share.provider.build_pod_env()["ROBOVAST_SFTP_HOST_KEY"].split() == key.split()[:2]
            )

    @pytest.mark.parametrize("variable", ["ROBOVAST_SFTP_KEY_FILE", "ROBOVAST_SFTP_KEY_PEM"])
    def test_a_key_opens_it(
        self, place: Place, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, variable: str
    ) -> None:
        monkeypatch.delenv("ROBOVAST_SFTP_PASSWORD")
        pem = place.secrets[1]
        (tmp_path / "key").write_text(pem)
        monkeypatch.setenv(variable, str(tmp_path / "key") if variable.endswith("FILE") else pem)
        with open_share() as share:
            share.provider.verify_access()
            assert share.provider.build_pod_env()["ROBOVAST_SFTP_KEY_PEM"] == pem

    def test_an_interrupted_upload_is_resumed(self, place: Place, tmp_path: Path) -> None:
        path = archive(tmp_path, 4 * MIB)

        def interrupt(done: int, total: int) -> None:
            if done > MIB:
                raise KeyboardInterrupt

        with open_share() as share:
            with pytest.raises(KeyboardInterrupt):
                share.provider.upload_archive(str(path), ARCHIVE, interrupt)
            assert share.campaigns() == []
            seen: list[int] = []
            share.provider.upload_archive(str(path), ARCHIVE, lambda done, _: seen.append(done))
        assert min(seen) > sftp_module.CHUNK
        assert place.content(ARCHIVE) == path.read_bytes()
        assert place.names() == {ARCHIVE}

    def test_a_folder_that_is_missing_is_explained(
        self, place: Place, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("ROBOVAST_SFTP_REMOTE_DIR", "other")
        with open_share() as share, pytest.raises(InputError, match="ROBOVAST_SFTP_REMOTE_DIR"):
            share.campaigns()


class TestGcs:
    @pytest.fixture
    def server(
        self, monkeypatch: pytest.MonkeyPatch, gcs_server: str, service_account: str
    ) -> Iterator[tuple[Place, Gate]]:
        with ExitStack() as stack:
            place, gate = gcs(stack, gcs_server, service_account)
            for name, value in place.env.items():
                monkeypatch.setenv(name, value)
            monkeypatch.setenv("ROBOVAST_SHARE_TYPE", "gcs")
            yield place, gate

    def test_an_upload_goes_on_behind_what_arrived(
        self, server: tuple[Place, Gate], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(gcs_module, "PART", 2**19)
        server[1].halves = 2
        path, seen = archive(tmp_path), list[int]()
        with open_share() as share:
            share.provider.upload_archive(str(path), path.name, lambda done, _: seen.append(done))
        assert server[0].content(ARCHIVE) == path.read_bytes()
        assert seen == [2**18, 2**19, MIB, path.stat().st_size]

    def test_an_upload_that_is_never_stored_ends(
        self, server: tuple[Place, Gate], tmp_path: Path
    ) -> None:
        server[1].stores_nothing = True
        with open_share() as share, pytest.raises(StorageError, match="3 times without storing it"):
            put(share, archive(tmp_path))
        assert server[0].names() == set()

    def test_an_archive_that_arrives_damaged_is_refused(
        self, server: tuple[Place, Gate], tmp_path: Path
    ) -> None:
        server[1].damages = True
        with open_share() as share, pytest.raises(StorageError, match="is damaged, or was changed"):
            put(share, archive(tmp_path))

    def test_an_archive_that_changes_during_its_upload_is_refused(
        self, server: tuple[Place, Gate], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(gcs_module, "PART", 2**19)
        path = archive(tmp_path)

        def edit(*_: object) -> None:
            with path.open("r+b") as file:
                file.write(b"other")

        with open_share() as share, pytest.raises(StorageError, match="was changed during"):
            share.provider.upload_archive(str(path), path.name, edit)

    def test_a_list_of_several_pages_is_read_to_its_end(
        self, server: tuple[Place, Gate], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(gcs_module, "PAGE", 1)
        names = [f"{name}.tar.gz" for name in "abc"]
        with open_share() as share:
            for name in names:
                (tmp_path / name).write_text(name)
                put(share, tmp_path / name)
            assert [item.archive for item in share.campaigns()] == names
        lists = [line for line in server[1].log if line.startswith("GET") and line.endswith("/o")]
        assert len(lists) == 3

    def test_a_public_bucket_needs_no_key(
        self, server: tuple[Place, Gate], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with open_share() as share:
            put(share, archive(tmp_path, 1000))
        monkeypatch.delenv("ROBOVAST_GCS_KEY_JSON")
        with open_share() as share, pytest.raises(StorageError, match="needs a public bucket"):
            share.campaigns()
        server[1].public = True
        with open_share() as share:
            assert download_from_share(share, [], tmp_path / "home")[0]
            with pytest.raises(InputError, match="ROBOVAST_GCS_KEY_FILE"):
                share.provider.verify_access()

    def test_the_account_must_be_allowed_to_upload(self, server: tuple[Place, Gate]) -> None:
        server[1].permissions.clear()
        with open_share() as share, pytest.raises(StorageError, match="Storage Object Creator"):
            share.provider.verify_access()

    def test_one_token_serves_several_requests(self, server: tuple[Place, Gate]) -> None:
        with open_share() as share:
            share.campaigns()
            share.provider.verify_access()
        assert len(server[1].assertions) == 1
        assert server[1].assertions[0].count(".") == 2

    def test_a_key_that_google_denies_is_to_be_checked(self, server: tuple[Place, Gate]) -> None:
        server[1].denies_keys = True
        with open_share() as share, pytest.raises(StorageError) as caught:
            share.verify()
        assert (
            "there is no access token (invalid_grant: Invalid JWT Signature.). Check the key in "
            "ROBOVAST_GCS_KEY_FILE." in str(caught.value)
        )
        assert not [secret for secret in server[0].secrets if secret in str(caught.value)]

    def test_a_login_serves_as_an_account(
        self, server: tuple[Place, Gate], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Google's libraries call it application default credentials; pods have no part of it."""
        place, gate = server
        monkeypatch.delenv("STORAGE_EMULATOR_HOST")  # of which a login is none of the business
        monkeypatch.delenv("ROBOVAST_GCS_KEY_JSON")
        monkeypatch.setenv("API_ENDPOINT_OVERRIDE", f"http://{place.proxy.address}")
        login = {"type": "service_account", **json.loads(place.env["ROBOVAST_GCS_KEY_JSON"])}
        (tmp_path / "login.json").write_text(json.dumps(login))
        monkeypatch.setenv("GOOGLE_APPLICATION_CREDENTIALS", str(tmp_path / "login.json"))
        path = archive(tmp_path)
        with open_share() as share:
            share.verify()
            put(share, path)
            assert set(share.provider.build_pod_env()) == {
                "ROBOVAST_GCS_BUCKET",
                "ROBOVAST_GCS_PREFIX",
            }
        assert place.content(ARCHIVE) == path.read_bytes()
        assert len(gate.assertions) == 1
        (tmp_path / "login.json").unlink()
        with open_share() as share, pytest.raises(InputError, match=r"CREDENTIALS: .*login\.json"):
            share.campaigns()

    def test_the_identity_of_a_workload_serves_as_an_account(
        self, server: tuple[Place, Gate], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Pods and machines of Google ask a server of metadata, whose address is read early."""
        place, gate = server
        with open_share() as share:
            put(share, archive(tmp_path, 1000))
        own = {name: value for name, value in os.environ.items() if "KEY" not in name}
        del own["STORAGE_EMULATOR_HOST"]
        env = {
            **own,
            "API_ENDPOINT_OVERRIDE": f"http://{place.proxy.address}",
            "GCE_METADATA_HOST": gate.address,
            "GCE_METADATA_IP": gate.address,
        }
        command = [VAST, "results", "remove-from-share", "--yes", "-i", NAME]
        result = subprocess.run(command, env=env, capture_output=True, text=True, timeout=120)
        assert (result.returncode, result.stderr) == (0, "")
        assert place.names() == set()


def test_an_own_login_is_found(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    metadata = "google.auth.compute_engine._metadata._NO_GCE_CHECK"
    monkeypatch.setattr(metadata, True)
    assert isinstance(gcs_module._credentials(), AnonymousCredentials)
    folder = tmp_path / ".config" / "gcloud"
    folder.mkdir(parents=True)
    login = {
        "client_id": "c",
        "client_secret": "s",
        "refresh_token": "r",
        "type": "authorized_user",
    }
    (folder / "application_default_credentials.json").write_text(json.dumps(login))
    assert gcs_module._credentials().refresh_token == "r"

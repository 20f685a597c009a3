"""Shares of any provider: third-party ones load unchanged, and their faults are named."""

from __future__ import annotations

import io
import os
import tarfile
from pathlib import Path

import pytest
from urllib3 import HTTPResponse

from robovast.base.environment import dotenv_loaded, environment
from robovast.base.errors import CannotRunError, InputError, RobovastError, StorageError
from robovast.execution.cluster_execution.share_providers.base import (
    BaseShareProvider,
    UploadProgressReader,
)
from robovast.storage.http_client import HttpClient
from robovast.storage.shares.campaigns import Share, download_from_share, open_share
from robovast.storage.shares.nextcloud import NextcloudShareProvider
from robovast.storage.shares.webdav import WebDavShareProvider, _files

GUIDE = """
import os

from robovast.execution.cluster_execution.share_providers.base import (
    BaseShareProvider,
    UploadProgressReader,
)

class MyShareProvider(BaseShareProvider):
    SHARE_TYPE = "myshare"

    def required_env_vars(self) -> dict[str, str]:
        return {
            "ROBOVAST_SHARE_URL": "URL of the target folder",
            "MY_SHARE_TOKEN":     "API token for the share service",
        }

    def build_pod_env(self) -> dict[str, str]:
        return {
            "MY_SHARE_URL":   os.environ["ROBOVAST_SHARE_URL"],
            "MY_SHARE_TOKEN": os.environ["MY_SHARE_TOKEN"],
        }

    def upload_archive(self, archive_path, object_name, progress_callback=None):
        total = os.path.getsize(archive_path)
        with open(archive_path, "rb") as fh:
            body = UploadProgressReader(
                fh, total, progress_callback=progress_callback)
            with open(os.environ["ROBOVAST_SHARE_URL"] + object_name, "wb") as out:
                while chunk := body.read(4):
                    out.write(chunk)
"""


@pytest.fixture(autouse=True)
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in [name for name in os.environ if name.startswith("ROBOVAST_")]:
        monkeypatch.delenv(name)
    (tmp_path / "p.py").write_text(GUIDE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_guides_provider_loads_unchanged(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBOVAST_SHARE_TYPE", f"{project}/p.py:MyShareProvider")
    (project / ".env").write_text(
        f"# comment\nexport ROBOVAST_OTHER=x\n"
        f"ROBOVAST_SHARE_URL='{project}/'\nMY_SHARE_TOKEN=\"a b\"\n"
    )
    (project / "x.tar.gz").write_bytes(b"0123456789")
    (project / "below").mkdir()
    seen: list[tuple[int, int]] = []
    with open_share(project / "below") as share:
        share.provider.verify_access()
        share.provider.upload_archive("x.tar.gz", "up.tar.gz", lambda *step: seen.append(step))
        assert share.provider.build_pod_env()["MY_SHARE_TOKEN"] == "a b"
        with pytest.raises(CannotRunError, match="`myshare` cannot list its archives"):
            share.campaigns()
    assert (project / "up.tar.gz").read_bytes() == b"0123456789"
    assert seen == [(4, 10), (8, 10), (10, 10)]
    assert "MY_SHARE_TOKEN" not in os.environ


def test_missing_variables_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="to one of gcs, nextcloud, sftp, webdav"), open_share():
        pass
    monkeypatch.setenv("ROBOVAST_SHARE_TYPE", "p.py:MyShareProvider")
    monkeypatch.setenv("MY_SHARE_TOKEN", "")
    with pytest.raises(InputError) as caught, open_share():
        pass
    assert "ROBOVAST_SHARE_URL: URL of the target folder" in str(caught.value)
    assert "MY_SHARE_TOKEN: API token" in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("webdaw", "Did you mean `webdav`"),
        ("p.py:os", "not a subclass of BaseShareProvider"),
        ("p.py:BaseShareProvider", "cannot be created: TypeError"),
    ],
)
def test_what_is_no_provider_is_refused(
    monkeypatch: pytest.MonkeyPatch, kind: str, message: str
) -> None:
    monkeypatch.setenv("ROBOVAST_SHARE_TYPE", kind)
    with pytest.raises(InputError, match=message), open_share():
        pass


def test_the_environment_counts_before_the_file(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pem = "-----BEGIN KEY-----\nabc\n-----END KEY-----"
    (project / ".env").write_text(f'A_VARIABLE=file\nB_VARIABLE="{pem}"\n')
    monkeypatch.setenv("A_VARIABLE", "shell")
    with dotenv_loaded():
        assert (os.environ["A_VARIABLE"], os.environ["B_VARIABLE"]) == ("shell", pem)
    assert environment()["B_VARIABLE"] == pem
    assert "B_VARIABLE" not in os.environ


class Memory(BaseShareProvider):
    """A share in memory that can be told what to do wrong."""

    SHARE_TYPE = "memory"

    def __init__(self, archives: dict[str, bytes]) -> None:
        self.archives = archives
        self.fault: Exception | None = None
        self.most = 10**9
        self.offsets: list[int] = []

    def required_env_vars(self) -> dict[str, str]:
        return {}

    def build_pod_env(self) -> dict[str, str]:
        return {}

    def upload_archive(self, *_: object) -> None: ...

    def list_campaign_archives_with_size(self) -> list[tuple[str, int]]:
        if self.fault:
            raise self.fault
        return [(name, len(content)) for name, content in self.archives.items()]

    def download_archive(
        self, object_name: str, dest: str, progress_callback: object = None, resume_offset: int = 0
    ) -> None:
        self.offsets.append(resume_offset)
        with open(dest, "ab" if resume_offset else "wb") as file:
            file.write(self.archives[object_name][resume_offset:][: self.most])


def archive(name: str) -> bytes:
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w:gz") as tar:
        tar.addfile(tarfile.TarInfo(f"{name}/_config/x.vast"))
    return content.getvalue()


def test_a_fault_of_a_provider_is_named() -> None:
    provider = Memory({})
    provider.fault = ValueError("what it says")
    with pytest.raises(StorageError, match="`memory` cannot list its archives: ValueError: what"):
        Share(provider).campaigns()


def test_a_download_that_stops_early_is_resumed_next_time(project: Path) -> None:
    provider = Memory({"a.tar.gz": archive("a")})
    provider.most = 30
    share = Share(provider)
    with pytest.raises(StorageError, match=r"30 of \d+ bytes of a\.tar\.gz are downloaded"):
        download_from_share(share, [], project / "home")
    provider.most = 10**9
    assert download_from_share(share, ["a"], project / "home")[0] == [project / "home" / "a"]
    assert provider.offsets == [0, 30]


def test_a_damaged_archive_is_fetched_anew(project: Path) -> None:
    provider = Memory({"a.tar.gz": archive("a")[:-10]})
    share = Share(provider)
    for _ in range(2):
        with pytest.raises(InputError, match="damaged or incomplete"):
            download_from_share(share, [], project / "home")
    assert provider.offsets == [0, 0]
    assert list((project / "home").iterdir()) == []


def test_names_that_lead_elsewhere_are_not_believed(project: Path) -> None:
    names = ["../evil.tar.gz", "/tmp/evil.tar.gz", ".hidden.tar.gz", "..", "good.tar.gz"]
    share = Share(Memory(dict.fromkeys(names, b"")))
    assert [item.name for item in share.campaigns()] == ["good"]


@pytest.mark.parametrize(
    ("link", "address"),
    [
        ("https://c.example.org/s/AbC", "https://c.example.org/public.php/webdav/"),
        ("https://e.org/nc/index.php/s/AbC/", "https://e.org/nc/public.php/webdav/"),
    ],
)
def test_a_nextcloud_link_is_understood(
    monkeypatch: pytest.MonkeyPatch, link: str, address: str
) -> None:
    monkeypatch.setenv("ROBOVAST_SHARE_URL", link)
    assert NextcloudShareProvider().address() == (address, "AbC", "")


def test_another_link_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOVAST_SHARE_URL", "https://c.example.org/apps/files")
    with pytest.raises(RobovastError, match="not a public link"):
        NextcloudShareProvider().address()


def test_a_webdav_address_must_be_one(monkeypatch: pytest.MonkeyPatch) -> None:
    variables = {"URL": "dav.example.org", "USER": "u", "PASSWORD": "p"}
    for name, value in variables.items():
        monkeypatch.setenv(f"ROBOVAST_WEBDAV_{name}", value)
    with pytest.raises(InputError, match="ROBOVAST_WEBDAV_URL does not begin with https"):
        WebDavShareProvider().list_campaign_archives_with_size()


@pytest.mark.parametrize(
    ("url", "warned"),
    [
        ("http://nas.lab/results/", True),
        ("https://nas.lab/results/", False),
        ("http://127.0.0.1:8080/results/", False),
        ("http://localhost/results/", False),
    ],
)
def test_an_account_that_goes_over_http_is_warned_of(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, url: str, *, warned: bool
) -> None:
    for name, value in {"URL": url, "USER": "u", "PASSWORD": "hidden"}.items():
        monkeypatch.setenv(f"ROBOVAST_WEBDAV_{name}", value)
    assert WebDavShareProvider()._client.name
    assert ("nas.lab: http:// does not encrypt the account" in caplog.text) is warned
    assert "hidden" not in caplog.text


def test_entities_in_a_servers_answer_are_refused() -> None:
    bomb = b'<!DOCTYPE x [<!ENTITY a "aaaa">]><multistatus xmlns="DAV:">&a;</multistatus>'
    with pytest.raises(ValueError, match="entities"):
        list(_files(bomb))


def test_a_body_can_be_begun_again(project: Path) -> None:
    (project / "x").write_bytes(b"0123456789")
    with (project / "x").open("rb") as file:
        body = UploadProgressReader(file, 10)
        assert len(body) == 10
        assert body.read() == b"0123456789"
        body.seek(0)
        assert (body.read(3), body.tell()) == (b"012", 3)


@pytest.mark.parametrize("content", [b"<html>", b"[1]"])
def test_an_answer_that_is_no_json_object_is_of_another_server(content: bytes) -> None:
    with pytest.raises(StorageError, match="share: the answer is not a JSON object"):
        HttpClient("share", {}).data(HTTPResponse(content))

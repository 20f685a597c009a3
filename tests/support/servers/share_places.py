"""Shares of every kind, on servers of the test's own behind proxies that can break."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote
from uuid import uuid4

import urllib3

from support.servers.cutting_proxy import CuttingProxy, cutting_proxy
from support.servers.gcs_gate import TOKEN, Gate, gcs_gate
from support.servers.shares import (
    PASSWORD,
    USER,
    SftpServer,
    sftp_server,
    webdav_server,
)


@dataclass
class Place:
    """A share that is ready to be used."""

    kind: str
    env: dict[str, str]
    proxy: CuttingProxy
    """Between the share's server and its user."""
    names: Callable[[], set[str]]
    """Names of everything on the share."""
    content: Callable[[str], bytes]
    secrets: list[str] = field(default_factory=list)


def webdav(stack: ExitStack, root: Path, kind: str) -> Place:
    """A WebDAV server; Nextcloud's public links are WebDAV at another path."""
    folder = root / "public.php" / "webdav" if kind == "nextcloud" else root / "my results"
    folder.mkdir(parents=True)
    user, password = ("AbC", "") if kind == "nextcloud" else (USER, PASSWORD)
    proxy = stack.enter_context(
        cutting_proxy(stack.enter_context(webdav_server(root, user, password)))
    )
    variables = {
        "nextcloud": {"ROBOVAST_SHARE_URL": f"http://{proxy.address}/s/AbC"},
        "webdav": {
            "ROBOVAST_WEBDAV_URL": f"http://{proxy.address}/my%20results",
            "ROBOVAST_WEBDAV_USER": user,
            "ROBOVAST_WEBDAV_PASSWORD": password,
        },
    }
    return Place(
        kind,
        variables[kind],
        proxy,
        lambda: {path.name for path in folder.iterdir()},
        lambda name: (folder / name).read_bytes(),
        [password] if password else [],
    )


def sftp(stack: ExitStack, root: Path, kind: str) -> Place:
    del kind
    folder = root / "results"
    folder.mkdir()
    server: SftpServer = stack.enter_context(sftp_server(root))
    proxy = stack.enter_context(cutting_proxy(f"127.0.0.1:{server.port}"))
    env = {
        "ROBOVAST_SFTP_HOST": "127.0.0.1",
        "ROBOVAST_SFTP_PORT": proxy.address.rpartition(":")[2],
        "ROBOVAST_SFTP_USER": USER,
        "ROBOVAST_SFTP_PASSWORD": PASSWORD,
        "ROBOVAST_SFTP_REMOTE_DIR": "results",
        "ROBOVAST_SFTP_HOST_KEY": server.host_key,
    }
    return Place(
        "sftp",
        env,
        proxy,
        lambda: {path.name for path in folder.iterdir()},
        lambda name: (folder / name).read_bytes(),
        [PASSWORD, server.client_key],
    )


def gcs(stack: ExitStack, server: str, pem: str) -> tuple[Place, Gate]:
    """A bucket of its own on fake-gcs-server, behind a gate that checks accounts."""
    gate = stack.enter_context(gcs_gate(server))
    proxy = stack.enter_context(cutting_proxy(gate.address))
    bucket = f"bucket-{uuid4().hex}"
    address = f"http://{proxy.address}"
    key = {"client_email": "a@b", "private_key": pem, "token_uri": f"{address}/token"}
    env = {
        "ROBOVAST_GCS_BUCKET": bucket,
        "ROBOVAST_GCS_PREFIX": "a folder/",
        "ROBOVAST_GCS_KEY_JSON": json.dumps(key),
        "STORAGE_EMULATOR_HOST": address,
    }
    api = f"http://{server}/storage/v1/b"
    assert urllib3.request("POST", api, json={"name": bucket}).status == 200
    objects = f"{api}/{bucket}/o"

    def names() -> set[str]:
        found = urllib3.request("GET", objects).json().get("items", [])
        return {item["name"].removeprefix("a folder/") for item in found}

    def content(name: str) -> bytes:
        address = f"{objects}/{quote(f'a folder/{name}', safe='')}?alt=media"
        return urllib3.request("GET", address).data

    return Place("gcs", env, proxy, names, content, [pem.splitlines()[1], TOKEN]), gate

"""From the cluster to a share and home, as a user types it."""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from robovast_testbed import network
from support.kube.lab import VAST, Lab
from support.patience import eventually
from support.servers import shares as share_servers
from support.servers.shares import PASSWORD, USER

from robovast.campaign.imported import MARK

WEBDAV_PORT, SFTP_PORT = 8480, 8422
FAR = """
import os
from robovast.base.errors import InputError
from robovast.execution.cluster_execution.share_providers.base import BaseShareProvider

class Far(BaseShareProvider):
    SHARE_TYPE = "far"

    def required_env_vars(self):
        return {}

    def build_pod_env(self):
        return {"IN_A_POD": "yes"}

    def verify_access(self):
        if os.environ.get("IN_A_POD"):
            raise InputError("the firewall says no")

    def upload_archive(self, archive_path, object_name, progress_callback=None): ...
"""
"""A share that the user's machine reaches, and the cluster does not."""


@dataclass
class Share:
    """A WebDAV and an SFTP server that pods reach, and a user beside them."""

    lab: Lab
    folder: Path
    """What the servers serve."""
    host_key: str

    @property
    def env(self) -> dict[str, str]:
        """What a user sets."""
        return {
            "ROBOVAST_SHARE_TYPE": "webdav",
            "ROBOVAST_WEBDAV_URL": f"http://{network.NODE_IP}:{WEBDAV_PORT}/",
            "ROBOVAST_WEBDAV_USER": USER,
            "ROBOVAST_WEBDAV_PASSWORD": PASSWORD,
        }

    @property
    def sftp(self) -> dict[str, str]:
        """What a user sets instead."""
        return {
            "ROBOVAST_SHARE_TYPE": "sftp",
            "ROBOVAST_SFTP_HOST": network.NODE_IP,
            "ROBOVAST_SFTP_PORT": str(SFTP_PORT),
            "ROBOVAST_SFTP_USER": USER,
            "ROBOVAST_SFTP_PASSWORD": PASSWORD,
            "ROBOVAST_SFTP_HOST_KEY": self.host_key,
        }

    def vast(self, *arguments: object, code: int = 0, **env: str) -> str:
        """What `vast` prints to somebody in the network of the cluster and the share."""
        cluster = self.lab.cluster
        given = {**self.env, "KUBECONFIG": str(cluster.inner_kubeconfig), **env}
        done = subprocess.run(
            ["nsenter", f"--net={cluster.bed.netns}", VAST, *map(str, arguments)],
            cwd=self.lab.folder,
            env={**os.environ, **given},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=400,
            check=False,
        )
        assert done.returncode == code, done.stdout
        return done.stdout

    def secret(self, name: str) -> dict[str, object]:
        """The same as a Secret for campaigns."""
        where = {"name": name, "namespace": self.lab.namespace}
        return {"apiVersion": "v1", "kind": "Secret", "metadata": where, "stringData": self.env}

    def upload(self, *arguments: object, code: int = 0, **env: str) -> str:
        """What `upload-to-share` prints."""
        where = ("-n", self.lab.namespace)
        return self.vast("exec", "cluster", "upload-to-share", *where, *arguments, code=code, **env)


@pytest.fixture
def share(lab: Lab) -> Iterator[Share]:
    folder = lab.folder / "served"
    folder.mkdir()
    ports = map(str, (WEBDAV_PORT, SFTP_PORT))
    command = [sys.executable, share_servers.__file__, folder, network.NODE_IP, *ports]
    server = lab.cluster.bed.spawn(f"share-{lab.namespace}", command)
    try:
        eventually(lambda: "serving" in server.log.read_text(), told=server.failure)
        keys = [line for line in server.log.read_text().splitlines() if "host key" in line]
        yield Share(lab, folder, keys[0].partition("host key ")[2])
    finally:
        server.process.kill()
        server.process.wait()


def files(campaign: Path) -> dict[str, object]:
    """Content of every file but the mark of imports, and the target of every link."""
    found = (path for path in campaign.rglob("*") if path.name != MARK)
    paths = [path for path in found if path.is_symlink() or path.is_file()]
    return {
        path.relative_to(campaign).as_posix(): path.readlink()
        if path.is_symlink()
        else path.read_bytes()
        for path in paths
    }


def test_a_campaign_goes_to_the_share_and_comes_home(lab: Lab, share: Share) -> None:
    """No credential stays in the cluster; what a pod says reaches the user."""
    (lab.folder / "far.py").write_text(FAR)
    lab.cluster.apply(share.secret("robovast-webdav"))
    lab.quick("hall", 'echo "$1" >"$3/said"\n', share={"secretName": "robovast-webdav"})
    lab.wait("hall")
    direct = lab.download("hall")
    name = direct.name
    eventually(lambda: "Uploaded" in lab.kubectl("get", "events"), told="it is on the share")
    assert [path.name for path in share.folder.iterdir()] == [f"{name}.tar.gz"]
    share.vast("results", "download", "-o", lab.folder / "by-itself")
    assert files(lab.folder / "by-itself" / name) == files(direct)
    share.vast("results", "remove-from-share", "-y", "-i", name)
    lab.kubectl("delete", "jobs", "--selector=robovast.io/role=share")
    wrong = {"spec": {"share": {"secretName": "robovast-none"}, "attempt": 2}}
    lab.kubectl("patch", "campaign", "hall", "--type=merge", f"--patch={json.dumps(wrong)}")
    missing = "could not be uploaded to the file share: "
    eventually(lambda: missing in lab.kubectl("get", "events"), told="it says what is missing")
    lab.kubectl("delete", "jobs", "--selector=robovast.io/role=share")

    said = share.upload("--detach")
    (job,) = [item for item in lab.get("jobs")["items"] if "share" in item["metadata"]["name"]]
    (secret,) = [i for i in lab.get("secrets")["items"] if "share" in i["metadata"]["name"]]
    assert secret["metadata"]["ownerReferences"][0]["uid"] == job["metadata"]["uid"]
    assert base64.b64decode(secret["data"]["ROBOVAST_WEBDAV_PASSWORD"]).decode() == PASSWORD
    said = share.upload()
    assert f"{name}: " in said
    assert [path.name for path in share.folder.iterdir()] == [f"{name}.tar.gz"]
    shown = lab.kubectl("get", "jobs,pods,configmaps,events", "-o", "yaml")
    assert PASSWORD not in shown + said
    lab.kubectl("delete", "job", job["metadata"]["name"], "--ignore-not-found")
    eventually(lambda: "share" not in lab.kubectl("get", "secrets,pods", "-o", "name"))

    assert name in share.vast("results", "list-share")
    share.vast("results", "download", "-o", lab.folder / "fresh")
    assert files(lab.folder / "fresh" / name) == files(direct)
    share.vast("results", "remove-from-share", "-y", "-i", name)
    assert list(share.folder.iterdir()) == []

    share.upload(**share.sftp)
    assert [path.name for path in share.folder.iterdir()] == [f"{name}.tar.gz"]
    share.vast("results", "download", "-o", lab.folder / "again", **share.sftp)
    assert files(lab.folder / "again" / name) == files(direct)

    said = share.upload("-i", "hall", code=2, ROBOVAST_SHARE_TYPE="far.py:Far")
    assert f"{name} was not uploaded: the firewall says no" in said
    (line,) = [line for line in said.splitlines() if "kubectl" in line]
    assert "the firewall says no" in lab.kubectl(*line.rpartition("kubectl ")[2].split()[2:])

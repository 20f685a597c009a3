"""The container engine of a node."""

import json
import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from . import debian, gobuild, network, programs, scratch
from .bed import Bed
from .commands import run, wait_for

CNI_PLUGINS = "/usr/lib/cni"
CONFIG = """
version = 3
root = "{folder}/root"
state = "{folder}/state"
oom_score = 0
disabled_plugins = [
  "io.containerd.nri.v1.nri",
  "io.containerd.snapshotter.v1.blockfile",
  "io.containerd.snapshotter.v1.erofs",
]

[grpc]
address = "{folder}/containerd.sock"

[plugins."io.containerd.cri.v1.images"]
snapshotter = "overlayfs"

[plugins."io.containerd.cri.v1.images".pinned_images]
sandbox = "{pause}"

# Lowering a process's OOM score and AppArmor need more rights than a container host may have.
[plugins."io.containerd.cri.v1.runtime"]
restrict_oom_score_adj = true
disable_apparmor = true

[plugins."io.containerd.cri.v1.runtime".containerd.runtimes.runc]
runtime_type = "io.containerd.runc.v2"

[plugins."io.containerd.cri.v1.runtime".containerd.runtimes.runc.options]
BinaryName = "{runc}"

[plugins."io.containerd.cri.v1.runtime".cni]
bin_dirs = ["{cni_plugins}"]
conf_dir = "{folder}/cni"
"""


@dataclass(frozen=True)
class Containerd:
    """A running containerd."""

    folder: Path

    @property
    def endpoint(self) -> str:
        """Return the address of its socket, as the kubelet wants it."""
        return f"unix://{self.folder}/containerd.sock"

    def load(self, archive: Path) -> None:
        """Give the kubelet the images of a `docker save` archive."""
        run([*self._ctr(), "images", "import", "--local", archive])

    def named_by_digest(self, image: str) -> str:
        """Give an image the name that it has by its digest, and return that name."""
        listed = run([*self._ctr(), "images", "list", f"name=={image}"])
        digest = next(word for word in listed.split() if word.startswith("sha256:"))
        name = f"{image.rpartition(':')[0]}@{digest}"
        run([*self._ctr(), "images", "tag", "--force", image, name])
        return name

    def answers(self) -> bool:
        """Say whether it is ready."""
        probe = subprocess.run([*self._ctr(), "version"], capture_output=True, check=False)
        return probe.returncode == 0

    def _ctr(self) -> list[str | Path]:
        socket = self.folder / "containerd.sock"
        return [_program("ctr"), "--address", socket, "--namespace", "k8s.io"]


def of(bed: Bed) -> Containerd:
    """Return the containerd of a testbed, for images that its pods shall find."""
    return Containerd(bed.folder / "containerd")


def start(bed: Bed) -> Containerd:
    """Start containerd in a testbed, with the image that the kubelet needs for every pod.

    :raises Unavailable: when the machine lacks root, Go or a Debian package.
    :raises StartFailed: when it does not answer in time.
    """
    debian.require("runc", f"{CNI_PLUGINS}/bridge")
    engine = of(bed)
    (engine.folder / "cni").mkdir(parents=True)
    (engine.folder / "cni" / "bridge.conflist").write_text(json.dumps(_network(engine.folder)))
    config = engine.folder / "config.toml"
    config.write_text(
        CONFIG.format(
            folder=engine.folder,
            pause=scratch.image("pause"),
            runc=shutil.which("runc"),
            cni_plugins=CNI_PLUGINS,
        )
    )
    shims = _program("containerd-shim-runc-v2").parent
    daemon = bed.spawn(
        "containerd",
        [_program("containerd"), "--config", config],
        env={"PATH": f"{shims}:{os.environ['PATH']}"},
    )
    wait_for("containerd", engine.answers, failed=daemon.failure)
    engine.load(scratch.archive(gobuild.build_own("pause")))
    return engine


def _program(name: str) -> Path:
    return next(gobuild.build(p) for p in programs.CONTAINERD if p.name == name)


def _network(folder: Path) -> dict[str, object]:
    addresses = {
        "subnet": network.POD_CIDR,
        "rangeStart": network.FIRST_POD_IP,
        "gateway": network.NODE_IP,
    }
    bridge = {
        "type": "bridge",
        "bridge": network.BRIDGE,
        "hairpinMode": True,
        "ipam": {
            "type": "host-local",
            "dataDir": f"{folder}/ipam",
            "ranges": [[addresses]],
            "routes": [{"dst": "0.0.0.0/0"}],
        },
    }
    ports = {"type": "portmap", "capabilities": {"portMappings": True}}
    return {"cniVersion": "1.0.0", "name": "robovast-testbed", "plugins": [bridge, ports]}

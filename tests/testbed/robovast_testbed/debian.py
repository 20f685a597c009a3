"""Programs and a root file system from Debian."""

import os
import shutil
from pathlib import Path

from . import cache
from .commands import run
from .errors import Unavailable

OSMESA = "/usr/lib/x86_64-linux-gnu/libOSMesa.so.8"
PACKAGES = {
    "bridge": "iproute2",
    "bwrap": "bubblewrap",
    "chromium": "chromium",
    "conntrack": "conntrack",
    "debootstrap": "debootstrap",
    "docker": "docker.io",
    "dockerd": "docker.io",
    "dot": "graphviz",
    "ip": "iproute2",
    "iptables": "iptables",
    "nsenter": "util-linux",
    "openssl": "openssl",
    "redis-server": "redis-server",
    "runc": "runc",
    "shellcheck": "shellcheck",
    "Xvfb": "xvfb",
    OSMESA: "libosmesa6",
    "/usr/lib/cni/bridge": "containernetworking-plugins",
}
SUITE = "bookworm"
PYTHON = "3.11"  # of that suite
IN_ROOTFS = ("ca-certificates", "git", "procps", "python3", "python3-venv")
ROOTFS_VERSION = "2"


def require(*programs: str) -> None:
    """Install the Debian packages of what is missing of `programs` (keys of PACKAGES).

    :raises Unavailable: without root or apt-get.
    """
    if os.geteuid() != 0:
        raise Unavailable("the testbed needs root (network namespaces, mounts, cgroups)")
    with cache.locked("apt"):
        packages = sorted({PACKAGES[p] for p in programs if not _is_there(p)})
        if not packages:
            return
        if shutil.which("apt-get") is None:
            raise Unavailable(f"the testbed needs the Debian packages {', '.join(packages)}")
        env = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
        apt = ["apt-get", "-qq", "-o", "DPkg::Lock::Timeout=300"]
        run([*apt, "update"], env=env)
        run([*apt, "install", "--yes", "--no-install-recommends", *packages], env=env)


def _is_there(program: str) -> bool:
    return Path(program).exists() if "/" in program else shutil.which(program) is not None


def rootfs() -> Path:
    """Return the tar file of a minimal Debian with Python, as a base of test images."""

    def make(folder: Path) -> None:
        require("debootstrap")
        tree = folder / "rootfs"
        packages = ",".join(IN_ROOTFS)
        run(["debootstrap", "--variant=minbase", f"--include={packages}", SUITE, tree])
        for junk in ("var/cache/apt/archives", "var/lib/apt/lists", "usr/share/doc", "var/log"):
            shutil.rmtree(tree / junk, ignore_errors=True)
            (tree / junk).mkdir()
        run(["tar", "--numeric-owner", "-C", tree, "-cf", folder / "rootfs.tar", "."])
        shutil.rmtree(tree)

    return cache.once(f"rootfs/{SUITE}-{ROOTFS_VERSION}", make) / "rootfs.tar"

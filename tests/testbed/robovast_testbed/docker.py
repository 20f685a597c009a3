"""A private Docker daemon, with the compose plugin, that leaves the machine's own alone."""

import json
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

from . import debian, gobuild, programs
from .bed import Bed
from .commands import run, wait_for
from .errors import StartFailed


@dataclass(frozen=True)
class Docker:
    """A running daemon. Programs with `env` in their environment talk to it."""

    folder: Path

    @property
    def env(self) -> dict[str, str]:
        """Return the variables that lead a Docker client to this daemon."""
        return {
            "DOCKER_HOST": f"unix://{self.folder}/docker.sock",
            "DOCKER_CONFIG": f"{self.folder}/config",
            "DOCKER_BUILDKIT": "0",  # Debian's daemon has the classic builder only
        }

    def run(self, *arguments: str | Path) -> str:
        """Run a `docker` command to its end; return its standard output."""
        return run(["docker", *arguments], env=os.environ | self.env)

    def answers(self) -> bool:
        """Say whether the daemon is ready."""
        probe = ["docker", "version", "--format", "{{.Server.Version}}"]
        return (
            subprocess.run(
                probe, env=os.environ | self.env, capture_output=True, check=False
            ).returncode
            == 0
        )


def attach(bed: Bed) -> Docker:
    """Return the daemon of a testbed that is up already.

    :raises StartFailed: when none answers there.
    """
    docker = Docker(bed.folder / "docker")
    if not docker.answers():
        raise StartFailed(f"no Docker daemon in testbed {bed.name}; `up docker` starts one")
    return docker


def start(bed: Bed) -> Docker:
    """Start a daemon in the testbed and wait until it answers.

    :raises Unavailable: when the machine lacks root, Go or a Debian package.
    :raises StartFailed: when it does not come up in time.
    """
    debian.require("docker", "dockerd", "iptables", "runc")
    docker = Docker(bed.folder / "docker")
    plugins = docker.folder / "config" / "cli-plugins"
    plugins.mkdir(parents=True)
    (plugins / "docker-compose").symlink_to(gobuild.build(programs.COMPOSE))
    config = docker.folder / "daemon.json"
    config.write_text(json.dumps(_config(bed, docker)))
    daemon = bed.spawn("dockerd", ["dockerd", "--config-file", config])
    wait_for("dockerd", docker.answers, failed=daemon.failure)
    return docker


def _config(bed: Bed, docker: Docker) -> dict[str, object]:
    return {
        "hosts": [docker.env["DOCKER_HOST"]],
        "data-root": f"{docker.folder}/data",
        "exec-root": f"{docker.folder}/exec",
        "pidfile": f"{docker.folder}/pid",
        "cgroup-parent": bed.cgroup,
        "exec-opts": ["native.cgroupdriver=cgroupfs"],
        "oom-score-adjust": 0,  # lowering it needs CAP_SYS_RESOURCE
    }

"""The interface of all runtimes."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol


@dataclass(frozen=True)
class Limits:
    """Resource limits of a container; None means no limit."""

    cpus: float | None = None
    memory: int | None = None
    """[byte]"""
    gpus: int | None = None
    shm: int | None = None
    """Size of `/dev/shm`, shared by all containers of a job [byte]; None: the engine's own."""

    @property
    def unenforced(self) -> Limits:
        """What is given to a container whose CPU and memory are not limited."""
        return replace(self, cpus=None, memory=None)


@dataclass(frozen=True)
class StartSpec:
    """Everything that is needed to start a job."""

    token: str
    """Unique name of the job on this machine, `<campaign token>.<job>`."""
    work: Path
    """Folder for the runtime's own files."""
    config: Path
    """Folder that is `/config` inside the run."""
    out: Path
    """Folder that is `/out` inside the run."""
    job: Path
    """Folder that is `/out/_jobs/<job>` inside the run."""
    environment: Mapping[str, str]
    user: str
    """`uid:gid` of the processes in the container."""
    limits: Limits = field(default_factory=Limits)
    secondaries: Mapping[str, Limits] = field(default_factory=dict)
    """Secondary containers by name."""
    display: bool = False
    """Whether the containers may use the display of this machine."""
    confined: bool = False
    """Whether no program in the containers can gain permissions, such as with `sudo`."""


@dataclass(frozen=True)
class RuntimeIdentity:
    """What executes the runs."""

    image: str
    """Image reference, or the pinned executor of the process runtime."""
    digest: str
    """Content digest; empty if there is none."""
    content: str = ""
    """What identifies all that executes the runs; empty if nothing does."""


class Runtime(Protocol):
    """Starts and stops the processes of a job."""

    name: str
    config_dir: str | None
    """Path of the config folder inside a run; None means the real path. Known after `check`."""
    out_dir: str | None
    """Path of the output folder inside a run; None means the real path."""

    def check(self) -> RuntimeIdentity:
        """Check that runs can be started.

        Raises:
            CannotRunError: runs cannot be started; the message gives cause and remedy.
        """

    def start(self, spec: StartSpec, console: Path) -> subprocess.Popen[bytes]:
        """Start a job; the returned process ends with the job's main container."""

    def stop(self, spec: StartSpec, process: subprocess.Popen[bytes], grace: float) -> None:
        """Stop all processes of a running job."""

    def clean_up(self, spec: StartSpec) -> None:
        """Remove everything that a job left running, however it ended."""

    def clean_up_campaign(self, prefix: str) -> None:
        """Remove everything that a killed execution left running, by the prefix of its tokens."""

"""The interface of all runtimes, which start and stop the processes of a job."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol


@dataclass(frozen=True)
class Limits:
    """What a container may use; None is no limit."""

    cpus: float | None = None
    memory: int | None = None
    """[byte]"""
    gpus: int | None = None


@dataclass(frozen=True)
class JobSpec:
    """A job, ready to be started."""

    token: str
    """Unique name of the job on this machine, `<campaign token>.<job>`."""
    work: Path
    """Folder for the runtime's own files."""
    config: Path
    """Folder that the run sees as `/config`."""
    out: Path
    """Folder that the run sees as `/out`."""
    job: Path
    """Folder that the run sees as `/out/_jobs/<job>`."""
    environment: Mapping[str, str]
    user: str
    """`uid:gid` of the processes in the container."""
    limits: Limits = field(default_factory=Limits)
    secondaries: Mapping[str, Limits] = field(default_factory=dict)
    """Secondary containers by name."""


@dataclass(frozen=True)
class Identity:
    """What executes the runs."""

    image: str
    """Image reference, or the pinned executor of the process runtime."""
    digest: str
    """Content digest; empty when there is none."""


class Runtime(Protocol):
    """Starts and stops the processes of a job."""

    name: str
    config_dir: str | None
    """Where a run sees its config folder; None when it sees the real path. Known after `check`."""
    out_dir: str | None
    """Where a run sees its output folder; None when it sees the real path."""

    def check(self) -> Identity:
        """Make sure that runs can be started, before anything is.

        Raises:
            CannotRunError: why not, and what to do.
        """

    def start(self, spec: JobSpec, console: Path) -> subprocess.Popen[bytes]:
        """Start a job; the returned process ends when the job's main container does."""

    def stop(self, spec: JobSpec, process: subprocess.Popen[bytes], grace: float) -> None:
        """End a job that is still running, all of it."""

    def clean_up(self, spec: JobSpec) -> None:
        """Remove what a job left behind, after it ended in whatever way."""

    def clean_up_campaign(self, prefix: str) -> None:
        """Remove what an earlier, killed execution left running, by the prefix of its tokens."""

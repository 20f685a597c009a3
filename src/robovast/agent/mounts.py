"""The folders of a pod as our containers see them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Folders:
    """Where everything is; the defaults are those of the containers."""

    plan: Path = Path("/robovast/plan")
    """`campaign.json` and `document.vast`."""
    files: Path = Path("/robovast/files")
    """Files that belong to the document; need not exist."""
    credentials: Path = Path("/robovast/credentials")
    """`accessKey` and `secretKey`."""
    git: Path = Path("/robovast/git")
    """`username` and `password` of an account on a Git server; need not exist."""
    share: Path = Path("/robovast/share")
    """What a share's provider needs: each variable is a file."""
    receivers: Path = Path("/robovast/receivers")
    """`0/url`, `0/token`, `1/url`, …: what a notice's receivers keep in Secrets."""
    pods: Path = Path("/robovast/pods")
    """What Kubernetes says of the pods of runs, a file for each Job; need not exist."""
    work: Path = Path("/robovast/work")
    """The pod's own volume."""
    message: Path = Path("/dev/termination-log")
    """Where the termination message goes, when the file exists."""
    config_seen: str = "/config"
    """`config` as a run sees it."""
    out_seen: str = "/out"
    """`out` as a run sees it."""

    @property
    def inputs(self) -> Path:
        """The document with its files."""
        return self.work / "inputs"

    @property
    def config(self) -> Path:
        """What runs see as `/config`, read-only."""
        return self.work / "config"

    @property
    def out(self) -> Path:
        """What runs see as `/out`."""
        return self.work / "out"

    @property
    def answers(self) -> Path:
        """What the scripts in the run's containers tell the agent."""
        return self.out / ".job"

    @property
    def stored(self) -> Path:
        """Runs that are over, out of sight of those that follow."""
        return self.work / "stored"

    @property
    def scratch(self) -> Path:
        """For what only one command needs."""
        return self.work / "scratch"

    @property
    def pack(self) -> Path:
        """What `fetch` tells `agent`."""
        return self.work / "pack.json"

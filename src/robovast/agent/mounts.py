"""The folders of a pod as our containers see them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from robovast.agent.scripts import FOLDER
from robovast.execution.contract import CONFIG, OUT
from robovast.kubeapi.pod_contract.mounts import DOCUMENT_FILE, PLAN_FILE, Mount


@dataclass(frozen=True)
class Folders:
    """Paths of the folders; the defaults are those in the containers."""

    plan: Path = Path(Mount.PLAN.path)
    """`campaign_plan` and `document`."""
    files: Path = Path(Mount.FILES.path)
    """Files that belong to the document; need not exist."""
    credentials: Path = Path(Mount.CREDENTIALS.path)
    """`accessKey` and `secretKey`."""
    git: Path = Path(Mount.GIT.path)
    """`username` and `password` of an account on a Git server; need not exist."""
    share: Path = Path(Mount.SHARE.path)
    """Variables of a share's provider, one file each."""
    receivers: Path = Path(Mount.RECEIVERS.path)
    """`0/url`, `0/token`, `1/url`, …: Secrets of a notice's receivers."""
    pods: Path = Path(Mount.PODS.path)
    """Sightings of the pods of runs, a file for each Job; need not exist."""
    work: Path = Path(Mount.WORK.path)
    """The pod's own volume."""
    message: Path = Path("/dev/termination-log")
    """Where the termination message goes, when the file exists."""
    config_seen: str = CONFIG
    """`config` as a run sees it."""
    out_seen: str = OUT
    """`out` as a run sees it."""

    @property
    def campaign_plan(self) -> Path:
        """The file with the `CampaignPlan`."""
        return self.plan / PLAN_FILE

    @property
    def document(self) -> Path:
        """The document that was planned."""
        return self.plan / DOCUMENT_FILE

    @property
    def inputs(self) -> Path:
        """The document with its files."""
        return self.work / "inputs"

    @property
    def config(self) -> Path:
        """What runs see as `/config`, read-only."""
        return self.work / "config"

    @property
    def orders(self) -> Path:
        """What the scripts in the run's containers read: start.sh, its environment, orders."""
        return self.config / FOLDER

    @property
    def out(self) -> Path:
        """What runs see as `/out`."""
        return self.work / "out"

    @property
    def answers(self) -> Path:
        """Answers of the scripts in the run's containers."""
        return self.out / ".job"

    @property
    def stored(self) -> Path:
        """Finished runs, out of the sight of those that follow."""
        return self.work / "stored"

    @property
    def scratch(self) -> Path:
        """Temporary files of one command."""
        return self.work / "scratch"

    @property
    def pack(self) -> Path:
        """What the process that prepares the runs leaves to the agent."""
        return self.work / "pack.json"

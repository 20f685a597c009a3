"""Pods of a campaign as plain processes: the agent beside start.sh, and a real S3."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from uuid import uuid4

from robovast_testbed.s3 import Server

from robovast.agent.scripts import AWAIT, SHELL
from robovast.execution.local.process_environment import process_environment
from robovast.kubeapi.pod_contract.storage_address import ENDPOINT
from robovast.model.document import load_document
from robovast.model.expansion import compose, select_any
from robovast.model.packs import CampaignPlan, Entry, Owner, PlanSpec, first_blocks, format_breaks
from robovast.model.plan import breaks
from robovast.storage.bucket_names import bucket_name
from robovast.storage.bucket_runs import open_run
from robovast.storage.download_plan import plan_download
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.s3 import ObjectStore
from support.patience import PATIENCE, eventually

MARKER = "ROBOVAST_TEST_POD"


def pids_of(work: Path) -> Iterator[int]:
    """The processes of a pod."""
    mark = f"{MARKER}={work}\0".encode()
    for path in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            if mark in path.read_bytes():
                yield int(path.parent.name)


def keys_by_path(store: ObjectStore, bucket: str, prefix: str = "") -> dict[str, str]:
    """What a reader of a bucket gets: the object of each file."""
    plan = plan_download(store.objects(bucket, prefix), Path("nowhere"), force=True)
    runs = [open_run(store, bucket, run) for run in plan.runs]
    files = {file.path: file.item.key for run in runs for file in run.files}
    return {**files, **{file.path: file.item.key for file in plan.files}}


@dataclass
class Campaign:
    """A campaign whose plan and files are mounted, as the operator would do it."""

    root: Path
    vast: Path
    server: Server
    given: dict[str, Any] = field(default_factory=dict)
    """Further values of the plan; `campaign`, `owner` and `bucket` in place of new ones."""

    def __post_init__(self) -> None:
        self.pods: list[Pod] = []
        name = f"test-{uuid4().hex[:8]}-2026-01-02-030405"
        self.name = self.given.pop("campaign", name)
        owner = Owner(uid=str(uuid4()), namespace="lab", name="test", campaign=self.name)
        owner = self.given.pop("owner", owner)
        self.bucket = self.given.pop("bucket", bucket_name(self.name, uid=owner.uid))
        document = load_document(self.vast)
        select = self.given.get("select", ())
        searches = document.vast.search is not None
        with TemporaryDirectory() as scratch:
            made = () if searches else compose(document, Path(scratch)).variants
            variants = select_any(made, select) if made else []
            cuts = format_breaks(breaks(variants))
        names = dict.fromkeys(variant.entry for variant in variants)
        entries = tuple(
            Entry(name=name, variants=sum(v.entry == name for v in variants)) for name in names
        )
        image = self.given.pop("image", "registry/image:tag")
        runs = self.given.pop("runs", document.vast.execution.most_runs)
        self.endpoint = f"http://{self.server.endpoint}"
        self.plan = CampaignPlan(
            campaign=self.name,
            bucket=self.bucket,
            owner=owner,
            document=self.vast.name,
            **{"expansion": "pure", "seed": 7, **self.given},
            runs=runs,
            image=image,
            entries=entries,
            plan=None
            if searches
            else PlanSpec(
                blocks=first_blocks(entries, runs),
                runs_per_job=document.vast.execution.runs_per_start,
                breaks=cuts,
                by_variant=document.vast.execution.test() is not None,
            ),
        )
        self._mount()
        keys = Credentials(self.server.access_key, self.server.secret_key)
        self.store = ObjectStore(Endpoint.parse(self.endpoint), keys, patience=60)

    def _mount(self) -> None:
        plan, files, credentials = (self.root / n for n in ("plan", "files", "credentials"))
        for folder in (plan, credentials):
            folder.mkdir(parents=True)
        (plan / "campaign.json").write_text(self.plan.model_dump_json(exclude_none=True))
        shutil.copy(self.vast, plan / "document.vast")
        others = shutil.ignore_patterns(self.vast.name)
        shutil.copytree(self.vast.parent, files / "..data", ignore=others)
        for path in (files / "..data").iterdir():  # as Kubernetes mounts a ConfigMap
            (files / path.name).symlink_to(Path("..data") / path.name)
        (credentials / "accessKey").write_text(self.server.access_key)
        (credentials / "secretKey").write_text(self.server.secret_key)

    def change(self, **changes: object) -> None:
        """Mount a changed plan; pods that are there keep what they have read."""
        self.plan = self.plan.model_copy(update=changes)
        text = self.plan.model_dump_json(exclude_none=True)
        (self.root / "plan/campaign.json").write_text(text)

    def close(self) -> None:
        """Leave no process and no bucket."""
        for pod in self.pods:
            pod.kill()
        self.store.delete_bucket(self.bucket)

    def objects(self, prefix: str = "") -> list[str]:
        """Paths of what a reader of the bucket gets."""
        self.store.make_bucket(self.bucket)  # nothing is stored yet
        return sorted(path for path in keys_by_path(self.store, self.bucket, prefix))

    def read(self, path: str) -> str:
        key = keys_by_path(self.store, self.bucket, "/".join(path.split("/")[:2])).get(path)
        content = self.store.read(self.bucket, key) if key else None
        assert content is not None, f"{path} is missing"
        return content.decode()

    def record(self, run: str) -> Any:
        return json.loads(self.read(f"{run}/run.json"))

    def verdicts(self) -> dict[str, str]:
        """Verdict by run of everything that is stored."""
        keys = [key for key in self.objects() if key.endswith("/run.json")]
        return {
            key.removesuffix("/run.json"): json.loads(self.read(key))["verdict"] for key in keys
        }


class Pod:
    """One pod: a work folder, and processes in place of containers."""

    _numbers = count()

    def __init__(self, campaign: Campaign) -> None:
        self.campaign = campaign
        campaign.pods.append(self)
        self.number = next(self._numbers)
        self.name = f"pod-{self.number}"
        self.work = campaign.root / self.name
        self.work.mkdir()
        self.message_file = self.work / "termination-log"
        self.message_file.touch()
        self.processes: list[subprocess.Popen[bytes]] = []

    @property
    def out(self) -> Path:
        return self.work / "out"

    @property
    def script(self) -> Path:
        """What the containers of a run wait for: it is there when the run is prepared."""
        return self.work / "config/.robovast/start.sh"

    def command(self, name: str, *arguments: object, index: int = 0) -> subprocess.Popen[bytes]:
        """Start one of our own containers."""
        root = self.campaign.root
        return self._spawn(
            f"{name}.log",
            [
                *(sys.executable, "-m", "robovast.agent", name, *map(str, arguments)),
                *(
                    f"--{folder}={root / folder}"
                    for folder in ("plan", "files", "credentials", "pods")
                ),
                *(f"--work={self.work}", f"--message={self.message_file}"),
                *(f"--config-seen={self.work / 'config'}", f"--out-seen={self.out}"),
            ],
            {
                "JOB_COMPLETION_INDEX": str(index),
                "POD_NAME": self.name,
                ENDPOINT: self.campaign.endpoint,
            },
        )

    def task(self, name: str) -> int:
        """Do our own work on the whole campaign; returns the exit code."""
        return self.command(name).wait(PATIENCE)

    def start_run(self, secondary: str = "", silence: int = 120) -> subprocess.Popen[bytes]:
        """Start a container of the user's image; how long its agent may be silent before [s]."""
        environment = process_environment(print)
        text = AWAIT.read_text().replace("silence=120", f"silence={silence}")
        return self._spawn(
            f"start{secondary}.log",
            [*SHELL, "-c", text, str(self.script), *filter(None, [secondary])],
            {"PATH": f"{environment}/bin:{os.environ['PATH']}", "ENABLE_X11": "false"},
        )

    def _spawn(self, log: str, command: list[str], env: dict[str, str]) -> subprocess.Popen[bytes]:
        with (self.work / log).open("wb") as output:
            process = subprocess.Popen(
                command,
                env={**os.environ, **env, MARKER: str(self.work)},
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        self.processes.append(process)
        return process

    def prepare(self, index: int = 0, *arguments: object) -> int:
        """A pod that is killed when its runs are prepared: 0; its exit code if it ends before."""
        agent = self.command("agent", *arguments, index=index)
        eventually(lambda: agent.poll() is not None or self.script.exists())
        if agent.poll() is None:
            self.kill(agent)
            return 0
        return agent.returncode

    def run(self, index: int = 0, *arguments: object, secondaries: tuple[str, ...] = ()) -> int:
        """A pod from its beginning to its end; returns the agent's exit code."""
        containers = [self.start_run(name) for name in (*secondaries, "")]
        code = self.command("agent", *arguments, index=index).wait(2 * PATIENCE)
        assert [container.wait(PATIENCE) for container in containers] == [0] * len(containers)
        return code

    def start(self, index: int = 0) -> tuple[subprocess.Popen[bytes], subprocess.Popen[bytes]]:
        """Start the containers `robovast` and `agent`; both are at work then."""
        containers = self.start_run(), self.command("agent", index=index)
        eventually(self.script.exists)
        return containers

    def log(self, name: str) -> str:
        return (self.work / f"{name}.log").read_text()

    def message(self) -> Any:
        """The termination message, but for how long the runs took, and why some are bad."""
        said = json.loads(self.message_file.read_text())
        apart = ("executed", "seconds", "bad")
        return {key: value for key, value in said.items() if key not in apart}

    def bad(self) -> dict[str, str]:
        """Why the first bad runs are, as the pod says, by folder."""
        said = json.loads(self.message_file.read_text())
        return {told["run"]: f"{told['verdict']}: {told['reason']}" for told in said.get("bad", ())}

    def took(self) -> tuple[int, float]:
        """How many runs the pod says that it has executed, and for how long [s]."""
        said = json.loads(self.message_file.read_text())
        return said.get("executed", 0), said.get("seconds", 0.0)

    def kill(self, container: subprocess.Popen[bytes] | None = None) -> None:
        """End a container at once, or all of them, as the loss of a node does."""
        for pid in pids_of(self.work):
            if container is None or os.getsid(pid) == container.pid:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
        if container is not None:
            container.wait()
            return
        for process in self.processes:
            process.wait()

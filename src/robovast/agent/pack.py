"""The pack of a pod, as `fetch` passes it on to `agent`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from robovast.campaign.verdict import Verdict
from robovast.model.expansion.variant import Variant
from robovast.model.packs import Owner
from robovast.model.plan import PackStart, Run
from robovast.model.scenario import Scenario, ScenarioParameter


@dataclass(frozen=True, slots=True)
class PodStart(PackStart):
    """Runs of a pack that one start of the entrypoint executes."""

    own_name: str = ""

    @property
    def name(self) -> str:
        """Folder name below `_jobs`, as the pod sees it."""
        return self.own_name


@dataclass(frozen=True)
class Pack:
    """The runs of one completion index, and what the agent needs to store them."""

    campaign: str
    bucket: str
    owner: Owner | None
    """Whose the bucket is."""
    endpoint: str
    region: str | None
    image: str
    number: int
    """Number of the pack in the plan: jobs are named after it."""
    attempt: int
    runs: tuple[Run, ...]
    """All runs of the pod; their variants have no files."""
    done: Mapping[int, Verdict]
    """Verdicts of runs that were stored before, by run id."""
    first_job: int
    """The first number of a job of the pack that is free in the bucket, from 1."""
    scenario: Scenario
    timeout: int | None
    """Time limit of one run [s]."""
    secondaries: tuple[str, ...]
    """Names of secondary containers."""
    environment: Mapping[str, str]
    """Environment of the first job."""

    @property
    def left(self) -> tuple[Run, ...]:
        """Runs that are left to execute."""
        return tuple(run for run in self.runs if run.id not in self.done)

    @property
    def first(self) -> PodStart | None:
        """The first job; None when nothing is left to run."""
        return self.job(1, self.left) if self.left else None

    def job(self, number: int, runs: tuple[Run, ...]) -> PodStart:
        """A job of the pod.

        Args:
            number: 1, 2, … in the pod.
            runs: what it executes.
        """
        return PodStart(number, runs, self.job_name(self.first_job + number - 1))

    def job_name(self, number: int) -> str:
        """Name of the `number`-th job of the pack."""
        return job_name(self.number, number)

    def write(self, path: Path) -> None:
        """Write it as JSON; numbers that JSON lacks stay what they are."""
        data = {**asdict(self), "owner": self.owner and self.owner.model_dump()}
        path.write_text(json.dumps(data, default=str), encoding="utf-8")


def job_name(pack: int, number: int) -> str:
    """`job-PACK`, and for later jobs of the pack, from 2, `job-PACK-NUMBER`."""
    return f"job-{pack}" if number == 1 else f"job-{pack}-{number}"


def read_pack(path: Path) -> Pack:
    """The pack as `fetch` wrote it."""
    data = json.loads(path.read_text(encoding="utf-8"))
    done = {int(id_): Verdict(verdict) for id_, verdict in data["done"].items()}
    changed = {
        "owner": data["owner"] and Owner(**data["owner"]),
        "runs": tuple(map(_run, data["runs"])),
        "done": done,
        "scenario": _scenario(data["scenario"]),
        "secondaries": tuple(data["secondaries"]),
    }
    return Pack(**{**data, **changed})


def _scenario(data: Mapping[str, Any]) -> Scenario:
    return Scenario(data["name"], tuple(ScenarioParameter(**p) for p in data["parameters"]))


def _run(data: Mapping[str, Any]) -> Run:
    variant = data["variant"]
    keys = ("name", "entry", "parameters", "factors")
    return Run(
        data["id"], Variant(**{key: variant[key] for key in keys}), data["number"], data["seed"]
    )

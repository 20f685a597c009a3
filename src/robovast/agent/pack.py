"""The pack of a pod, as the process that prepares it passes it on to the agent."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from robovast.base.safe_paths import MOST_OF_ALL, read_file
from robovast.base.sequential import SequentialTest
from robovast.campaign.decisions import decide, runs_to_start
from robovast.campaign.verdict import Verdict
from robovast.execution.run_key import chained_keys
from robovast.model.packs import Owner
from robovast.model.plan import PackStart, Run
from robovast.model.scenario import Scenario, ScenarioParameter
from robovast.model.variant import Variant


@dataclass(frozen=True, slots=True)
class PodStart(PackStart):
    """Runs of a pack that one start of the entrypoint executes."""

    own_name: str = ""

    @property
    def name(self) -> str:
        """Folder name below `_jobs`, as the pod sees it."""
        return self.own_name


@dataclass(frozen=True)
class Deciding:
    """A pack of one variant, of whose runs as many are executed as a test needs."""

    test: SequentialTest
    most: int
    """Most runs of a job."""
    others: Mapping[int, Verdict]
    """Verdicts of the variant's runs that are not in the pack, by number."""
    again: tuple[int, ...]
    """Numbers of runs that an earlier attempt has stored: they are executed in any case."""

    def next_runs(self, left: Sequence[Run], stored: Mapping[int, Verdict]) -> tuple[Run, ...]:
        """The runs of the next job.

        Args:
            left: runs of the pack that are not stored, in order.
            stored: verdicts of those that are, by number.
        """
        again = [run for run in left if run.number in self.again]
        if again:
            return tuple(again[: self.most])
        decision = decide(self.test, {**self.others, **stored})
        by_number = {run.number: run for run in left}
        numbers = runs_to_start(decision, list(by_number), self.most)
        return tuple(map(by_number.__getitem__, numbers))


@dataclass(frozen=True)
class KeyParts:
    """What the keys of a pack's runs are made of (robovast.execution.run_key)."""

    common: str
    own: Mapping[int, list[Any]]
    """By run id."""


@dataclass(frozen=True)
class Pack:
    """The runs of one completion index, and what the agent needs to store them."""

    campaign: str
    bucket: str
    owner: Owner
    """Whose the bucket is."""
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
    deciding: Deciding | None = None
    """What decides how many of the runs are needed; None if all are."""
    keys: KeyParts | None = None
    """Of the runs; None if they are not reused, nor offered to others."""

    def keys_of(self, job: PackStart) -> dict[int, str]:
        """The keys of a job's runs by id; nothing if they have none."""
        if self.keys is None:
            return {}
        return chained_keys(self.keys.common, job, self.keys.own)

    @property
    def left(self) -> tuple[Run, ...]:
        """Runs that are not stored."""
        return tuple(run for run in self.runs if run.id not in self.done)

    @property
    def first(self) -> PodStart | None:
        """The first job; None when nothing is left to run."""
        runs = self.next_runs(self.done)
        return self.job(1, runs) if runs else None

    def next_runs(self, verdicts: Mapping[int, Verdict]) -> tuple[Run, ...]:
        """The runs of the next job; none when no other is needed.

        Args:
            verdicts: of the runs that are stored, by id.
        """
        left = [run for run in self.runs if run.id not in verdicts]
        if self.deciding is None or not left:
            return tuple(left)
        stored = {run.number: verdicts[run.id] for run in self.runs if run.id in verdicts}
        return self.deciding.next_runs(left, stored)

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
        data = {**asdict(self), "owner": self.owner.model_dump()}
        path.write_text(json.dumps(data, default=str), encoding="utf-8")


def job_name(pack: int, number: int) -> str:
    """`job-PACK`, and for later jobs of the pack, from 2, `job-PACK-NUMBER`."""
    return f"job-{pack}" if number == 1 else f"job-{pack}-{number}"


def read_pack(path: Path) -> Pack:
    """The pack as it was written."""
    data = json.loads(read_file(path, most=MOST_OF_ALL))
    done = {int(id_): Verdict(verdict) for id_, verdict in data["done"].items()}
    changed = {
        "owner": Owner(**data["owner"]),
        "runs": tuple(map(_run, data["runs"])),
        "done": done,
        "scenario": _scenario(data["scenario"]),
        "secondaries": tuple(data["secondaries"]),
        "deciding": data["deciding"] and _deciding(data["deciding"]),
        "keys": data["keys"] and _keys(data["keys"]),
    }
    return Pack(**{**data, **changed})


def _deciding(data: Mapping[str, Any]) -> Deciding:
    others = {int(number): Verdict(verdict) for number, verdict in data["others"].items()}
    test = SequentialTest(**data["test"])
    return Deciding(test, data["most"], others, tuple(data["again"]))


def _keys(data: Mapping[str, Any]) -> KeyParts:
    return KeyParts(data["common"], {int(id_): own for id_, own in data["own"].items()})


def _scenario(data: Mapping[str, Any]) -> Scenario:
    return Scenario(data["name"], tuple(ScenarioParameter(**p) for p in data["parameters"]))


def _run(data: Mapping[str, Any]) -> Run:
    variant = data["variant"]
    keys = ("name", "entry", "parameters", "factors")
    return Run(
        data["id"], Variant(**{key: variant[key] for key in keys}), data["number"], data["seed"]
    )

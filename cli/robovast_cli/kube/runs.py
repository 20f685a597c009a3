"""The runs of a campaign on a cluster: who executes them, and what of them is stored."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from robovast.base.errors import CannotRunError, InputError
from robovast.base.ranges import Span
from robovast.campaign.layout import INDEX, JOBS, LOGS, RUN_RECORD, parameters_key
from robovast.campaign.run_record import RunRecord, parse_run_record
from robovast.kubeapi.pod_contract.pack_request import PackRequest
from robovast.kubeapi.resources import ROLE_LABEL, SHARD_ROLE, UID_LABEL
from robovast_cli.kube.api import Json, Kubernetes
from robovast_cli.kube.planned_runs import PlannedRuns, planned_runs, split_run
from robovast_cli.kube.pods import is_live
from robovast_cli.kube.status import CampaignState
from robovast_cli.kube.store import StorePlace, open_store

if TYPE_CHECKING:
    from robovast.storage.s3 import ObjectStore

SIDE_BY_SIDE = 8
"""Records that are read at once."""


@dataclass(frozen=True)
class Executor:
    """A pod that is there for a run."""

    pod: Json
    ids: Sequence[int]
    """Ids of the runs that the pod executes."""
    attempt: int

    @property
    def runs(self) -> int:
        """How many runs it is for."""
        return len(self.ids)

    @property
    def name(self) -> str:
        """Of the pod."""
        return str(self.pod["metadata"]["name"])


class CampaignRuns:
    """The runs of a campaign; their state is requested when it is needed."""

    def __init__(
        self,
        kube: Kubernetes,
        campaign: CampaignState | None,
        bucket: str,
        place: StorePlace,
        stack: ExitStack,
    ) -> None:
        """
        Args:
            kube: the cluster.
            campaign: None when it was removed, and only its bucket is left.
            bucket: of its results; empty before it has one.
            place: the bucket's server.
            stack: ends with what is opened here.
        """
        self._kube = kube
        self.campaign = campaign
        self._bucket = bucket
        self._place = place
        self._stack = stack

    @cached_property
    def _store(self) -> ObjectStore:
        return self._stack.enter_context(open_store(self._kube, self._place))

    @cached_property
    def planned(self) -> PlannedRuns | None:
        """The runs of the campaign; None if they are not known yet, or no longer."""
        if self.campaign is None:
            return None
        return planned_runs(self._kube, self.campaign, lambda: self._store)

    def check_accepted(self) -> None:
        """Make sure that the campaign has runs, or will have.

        Raises:
            InputError: the operator has refused it.
        """
        campaign = self.campaign
        if campaign is not None and campaign.rejected and self.planned is None:
            why = "; ".join(campaign.messages)
            raise InputError(f"{campaign.name} was rejected, so it has no runs: {why}")

    def executor(self, run: str) -> Executor | None:
        """The pod that is there for a run; None when there is none.

        Raises:
            InputError: the campaign has no such run.
        """
        if self.planned is None:
            _refuse_no_folder(run)
            return None
        id_ = self.planned.id_of(run)
        return next((found for found in self.executors() if id_ in found.ids), None)

    def executors(self) -> Iterator[Executor]:
        """The pods that are there for runs, the newest first."""
        if self.campaign is None or self.planned is None:
            return
        for pod in reversed(
            self._kube.pods({UID_LABEL: self.campaign.uid, ROLE_LABEL: SHARD_ROLE})
        ):
            request = PackRequest.of_pod(pod)
            if request is not None and is_live(pod):
                ids = self._ids_of(request, self.planned)
                if ids:
                    yield Executor(pod, ids, request.attempt)

    def _ids_of(self, request: PackRequest, planned: PlannedRuns) -> Sequence[int]:
        """Ids of a pod's runs; none of one that is not as the plan says."""
        try:
            return request.chosen(planned.plan, self._bad_runs)[1]
        except (IndexError, ValueError):
            return ()

    def _bad_runs(self, name: str) -> list[Span]:
        from robovast.agent.campaign import bad_runs

        return bad_runs(self._store, self._bucket, name)

    def record(self, run: str) -> RunRecord | None:
        """The record of a run; None when it is not stored.

        Without access to its storage, a campaign that has no bucket as far as its status knows
        has stored nothing.
        """
        try:
            found = self._store.read(self._bucket, f"{run}/{RUN_RECORD}") if self._bucket else None
        except CannotRunError:
            if self.campaign is None or self.campaign.status.bucket:
                raise
            return None
        return None if found is None else parse_run_record(found)

    def bad(self) -> list[str]:
        """Failed and errored runs by folder: those of the index, else of the status so far."""
        if self._bucket and (self.campaign is None or self.campaign.finished):
            index = self._store.read(self._bucket, INDEX)
            if index is not None:
                runs = json.loads(index)["runs"]
                return [f"{r['variant']}/{r['run']}" for r in runs if r["verdict"] != "passed"]
        if self.campaign is None or self.planned is None:
            return []
        status = self.campaign.status
        return self.planned.paths_of(status.failed_runs, status.errored_runs)

    def bad_records(self) -> Iterator[tuple[str, RunRecord | None]]:
        """Failed and errored runs by folder, and what was stored of them."""
        bad = self.bad()
        with ThreadPoolExecutor(SIDE_BY_SIDE) as readers:
            yield from zip(bad, readers.map(self.record, bad), strict=True)

    def runs_of_job(self, job: str) -> int:
        """How many runs a job was begun for; 1 if unknown."""
        found = self._store.read(self._bucket, parameters_key(job)) or b""
        return found.count(b"_output_dir:") or 1

    @contextmanager
    def stored_log(self, job: str, path: str) -> Iterator[Path]:
        """A stored log of a job, brought here as long as the context lasts.

        Raises:
            InputError: there is none of this name.
        """
        prefix = f"{JOBS}/{job}/"
        there = {o.key: o for o in self._store.objects(self._bucket, f"{prefix}{LOGS}/")}
        if prefix + path not in there:
            names = ", ".join(key.removeprefix(prefix) for key in there) or "none"
            raise InputError(f"{job} has no stored log `{path}`; its stored logs: {names}.")
        with TemporaryDirectory() as folder:
            target = Path(folder) / "log"
            self._store.get_file(self._bucket, there[prefix + path], target)
            yield target


def _refuse_no_folder(run: str) -> None:
    """Reject an invalid name of a run if the runs are unknown.

    Raises:
        InputError: it is no folder of a run.
    """
    try:
        split_run(run)
    except ValueError:
        raise InputError(
            f"`{run}` is not a valid run", hint="name its folder, for example `hall-1/0`"
        ) from None

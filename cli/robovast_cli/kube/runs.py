"""The runs of a campaign on a cluster: their pods, and their stored records and logs."""

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
from robovast_cli.kube.api import Json, KubernetesClient
from robovast_cli.kube.planned_runs import RunNames, planned_runs, split_run
from robovast_cli.kube.pods import is_live
from robovast_cli.kube.status import CampaignState
from robovast_cli.kube.store import StorePlace, open_store

if TYPE_CHECKING:
    from robovast.storage.s3 import ObjectStore

MAX_READERS = 8
"""Maximum number of records that are read in parallel."""


@dataclass(frozen=True)
class Executor:
    """A pod that runs or will run some runs."""

    pod: Json
    ids: Sequence[int]
    """Ids of the runs of the pod."""
    attempt: int

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.ids)

    @property
    def name(self) -> str:
        """Name of the pod."""
        return str(self.pod["metadata"]["name"])


class CampaignRuns:
    """Requests the state of the runs of a campaign."""

    def __init__(
        self,
        kube: KubernetesClient,
        campaign: CampaignState | None,
        bucket: str,
        place: StorePlace,
        stack: ExitStack,
    ) -> None:
        """
        Args:
            kube: client of the cluster.
            campaign: None if it was deleted and only its bucket exists.
            bucket: bucket of the results; empty if none exists.
            place: S3 server of the bucket.
            stack: closes the connection to the S3 server.
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
    def planned(self) -> RunNames | None:
        """The planned runs; None before they are planned, and after the Campaign was deleted."""
        if self.campaign is None:
            return None
        return planned_runs(self._kube, self.campaign, lambda: self._store)

    def check_accepted(self) -> None:
        """Raise an InputError if the operator has rejected the campaign before it planned runs."""
        campaign = self.campaign
        if campaign is not None and campaign.rejected and self.planned is None:
            why = "; ".join(campaign.messages)
            raise InputError(
                f"{campaign.name} was rejected, so it has no runs: {why}",
                hint="fix the cause, then create the campaign again",
            )

    def executor(self, run: str) -> Executor | None:
        """Return the pod of a run, or None.

        Raises:
            InputError: the campaign has no such run.
        """
        if self.planned is None:
            _check_run_name(run)
            return None
        id_ = self.planned.id_of(run)
        return next((found for found in self.executors() if id_ in found.ids), None)

    def executors(self) -> Iterator[Executor]:
        """Yield the pods of runs, the newest first."""
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

    def _ids_of(self, request: PackRequest, planned: RunNames) -> Sequence[int]:
        """Return the ids of a pod's runs; nothing if the pod does not match the plan."""
        try:
            return request.chosen(planned.plan, self._bad_runs)[1]
        except (IndexError, ValueError):
            return ()

    def _bad_runs(self, name: str) -> list[Span]:
        from robovast.agent.campaign import bad_runs

        return bad_runs(self._store, self._bucket, name)

    def record(self, run: str) -> RunRecord | None:
        """Return the record of a run; None if it is not stored.

        Without access to the storage, a campaign whose status names no bucket has stored nothing.
        """
        try:
            found = self._store.read(self._bucket, f"{run}/{RUN_RECORD}") if self._bucket else None
        except CannotRunError:
            if self.campaign is None or self.campaign.status.bucket:
                raise
            return None
        return None if found is None else parse_run_record(found)

    def bad(self) -> list[str]:
        """Return the folders of failed and errored runs, from the index, else from the status."""
        if self._bucket and (self.campaign is None or self.campaign.finished):
            index = self._store.read(self._bucket, INDEX)
            if index is not None:
                runs = json.loads(index)["runs"]
                return [f"{r['variant']}/{r['run']}" for r in runs if r["verdict"] != "passed"]
        if self.campaign is None or self.planned is None:
            return []
        status = self.campaign.status
        return self.planned.find_commands(status.failed_runs, status.errored_runs)

    def unsuccessful_records(self) -> Iterator[tuple[str, RunRecord | None]]:
        """Yield the folder and the stored record of each failed and errored run."""
        bad = self.bad()
        with ThreadPoolExecutor(MAX_READERS) as readers:
            yield from zip(bad, readers.map(self.record, bad), strict=True)

    def runs_of_job(self, job: str) -> int:
        """Return the number of runs of a job; 1 if unknown."""
        found = self._store.read(self._bucket, parameters_key(job)) or b""
        return found.count(b"_output_dir:") or 1

    @contextmanager
    def stored_log(self, job: str, path: str) -> Iterator[Path]:
        """Yield a temporary copy of a stored log of a job.

        Raises:
            InputError: there is none of this name.
        """
        prefix = f"{JOBS}/{job}/"
        stored = {o.key: o for o in self._store.objects(self._bucket, f"{prefix}{LOGS}/")}
        if prefix + path not in stored:
            names = ", ".join(key.removeprefix(prefix) for key in stored) or "none"
            raise InputError(
                f"{job} has no stored log `{path}`; its stored logs: {names}.",
                hint="use one of the stored logs",
            )
        with TemporaryDirectory() as folder:
            target = Path(folder) / "log"
            self._store.get_file(self._bucket, stored[prefix + path], target)
            yield target


def _check_run_name(run: str) -> None:
    """Raise an InputError if a text cannot be the folder of a run."""
    try:
        split_run(run)
    except ValueError:
        raise InputError(
            f"`{run}` is not a valid run", hint="name its folder, for example `hall-1/0`"
        ) from None

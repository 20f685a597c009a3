"""The reconcile loop of one Campaign: look, decide, act. Effects only; what to do is `decide`."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from robovast.cluster.plan import Entry
from robovast.cluster.resources import API_VERSION, CampaignSpec
from robovast.cluster.status import CampaignStatus, compact
from robovast_operator import paths
from robovast_operator.accept import (
    DOCUMENT_CHANGED,
    Files,
    accept,
    config_map_files,
    inline_files,
    same_document,
    with_composition,
)
from robovast_operator.additions import Additions, with_additions
from robovast_operator.api import Api, ApiError
from robovast_operator.campaign import Accepted, Identity, Key, Object, Rejected, Revision
from robovast_operator.conditions import is_news, is_settled, is_true, rejected_conditions
from robovast_operator.configurations import configuration_status, is_own, own_configurations
from robovast_operator.decide import (
    Action,
    CreateShard,
    CreateTask,
    Decision,
    DeleteJob,
    Observed,
    ResizeJob,
    SuspendJob,
    decide,
)
from robovast_operator.diagnose import Diagnosis
from robovast_operator.events import event, messages
from robovast_operator.jobs import files_config_map, plan_config_map, shard_job, task_job
from robovast_operator.memory import Memory
from robovast_operator.pod_facts import composed_of
from robovast_operator.purge import Purge
from robovast_operator.revisions import NO_PLAN, next_revision, owners_note, read_revisions
from robovast_operator.settings import Settings
from robovast_operator.store import JobState, Store
from robovast_operator.times import format_time, now
from robovast_operator.work_queue import WorkQueue

LOGGER = logging.getLogger(__name__)


class Reconciler:
    """Brings campaigns from what is there to what is wanted."""

    def __init__(self, api: Api, store: Store, queue: WorkQueue, settings: Settings) -> None:
        self._api = api
        self._store = store
        self._queue = queue
        self._settings = settings
        self._memories: dict[Key, Memory] = {}
        self._diagnosis = Diagnosis(api, settings)
        self._purge = Purge(api, settings)

    async def __call__(self, key: Key) -> None:
        """Look at a Campaign; a failure is logged, and it is looked at again later."""
        try:
            await self._reconcile(key)
        except (TimeoutError, ApiError, OSError) as error:
            delay = self._queue.add_failed(key)
            LOGGER.warning("%s/%s: %s; again in %.0f s", *key, error, delay)
        except Exception:
            delay = self._queue.add_failed(key)
            LOGGER.exception("%s/%s: a fault of the operator; again in %.0f s", *key, delay)
        else:
            self._queue.succeeded(key)

    async def _reconcile(self, key: Key) -> None:
        obj = self._store.campaigns.get(key)
        if obj is None:
            self._memories.pop(key, None)
            return
        identity = Identity.of(obj)
        memory = self._memories.get(key)
        if memory is None or memory.uid != identity.uid:
            memory = self._memories[key] = Memory(identity.uid)
        jobs = self._store.jobs_of(key, identity.uid)
        if "deletionTimestamp" in obj["metadata"]:
            await self._deleted(obj, memory, jobs)
        elif not is_settled(obj, jobs, self._store.configurations_of(key)):
            await self._advance(obj, memory, jobs)

    async def _advance(self, obj: Object, memory: Memory, jobs: dict[str, JobState]) -> None:
        await self._purge.protect(obj)
        accepted = await self._accepted(obj, memory)
        if isinstance(accepted, Accepted) and not (accepted.pure or accepted.entries):
            composed = await self._composed(accepted, memory, jobs)
            if composed is None:
                return
            accepted = composed
        if isinstance(accepted, Rejected):
            await self._reject(obj, accepted)
            return
        await self._execute(obj, accepted, memory, jobs)

    async def _execute(
        self, obj: Object, accepted: Accepted, memory: Memory, jobs: dict[str, JobState]
    ) -> None:
        """Bring an accepted campaign further."""
        await self._make_inputs(accepted, memory)
        additions = await self._additions(obj, accepted)
        revisions = await self._revisions(accepted, additions, memory)
        if not same_document(revisions[0].document, accepted.spec.vast):
            await self._reject(obj, DOCUMENT_CHANGED)
            return
        memory.notice(jobs)
        status = CampaignStatus.model_validate(obj.get("status") or {})
        again = await self._diagnosis.update(accepted, memory, jobs)
        observed = Observed(
            accepted=accepted,
            generation=obj["metadata"]["generation"],
            status=status,
            revisions=revisions,
            jobs=jobs,
            now=now(),
            reports={name: reports for name, (_, reports) in memory.reports.items()},
            trouble=memory.trouble,
            finals=memory.finals,
            quota=memory.quota,
        )
        decision = decide(observed)
        await self._carry_out(obj, accepted, decision, memory)
        await self._tell_configurations(obj, accepted, revisions[-1], decision.status, memory)
        for delay in (again, decision.again):
            if delay is not None:
                self._queue.add((accepted.identity.namespace, accepted.identity.name), delay)

    async def _accepted(self, obj: Object, memory: Memory) -> Accepted | Rejected:
        """The Campaign as far as it can be checked here; once for each change of its spec."""
        mark = str(obj["metadata"]["generation"])
        if memory.accepted is None or memory.accepted_for != mark:
            files = await self._files(obj)
            if isinstance(files, Rejected):
                return files
            memory.accepted = await asyncio.to_thread(accept, obj, files, self._settings)
            memory.accepted_for = mark
        return memory.accepted

    async def _files(self, obj: Object) -> Files | Rejected | None:
        """The input files, as far as the operator can read them."""
        try:
            source = CampaignSpec.model_validate(obj["spec"]).source
            if source.bundle is not None or source.git is not None:
                return None
            if source.config_map is None:
                return inline_files(obj["spec"])
        except ValueError:
            return {}  # checking the spec says what is wrong
        name, namespace = source.config_map.name, obj["metadata"]["namespace"]
        try:
            data = await self._api.get(f"{paths.config_maps(namespace)}/{name}")
        except ApiError as error:
            if error.code != 404:
                raise
            self._queue.add((namespace, obj["metadata"]["name"]), 10)
            return Rejected(
                "SourceNotFound",
                f"spec.source.configMap: the namespace {namespace} has no ConfigMap `{name}`",
            )
        return config_map_files(data, {item.key: item.path for item in source.config_map.items})

    async def _composed(
        self, accepted: Accepted, memory: Memory, jobs: dict[str, JobState]
    ) -> Accepted | Rejected | None:
        """The campaign with what its compose Job found out; None while that is at work."""
        identity = accepted.identity
        if memory.revisions is None:
            memory.revisions = await self._load_revisions(identity)
        if memory.revisions:
            entries = memory.revisions[0].entries
            own = entries[: len(accepted.vast.configuration or [None])]
            return replace(accepted, entries=own)
        await self._make_inputs(accepted, memory)
        name = identity.child("compose")
        job = jobs.get(name)
        if job is None:
            plan = identity.child("plan-compose")
            await self._create_plan(accepted, Revision(-1, plan, NO_PLAN), ())
            await self._create_job(task_job(accepted, self._settings, "compose", name, plan))
        elif job.finished:
            pods = [pod async for pod in self._diagnosis.pods_of(job)]
            return with_composition(accepted, composed_of(pods))
        await self._tell_composing(accepted, memory, jobs)
        return None

    async def _tell_composing(
        self, accepted: Accepted, memory: Memory, jobs: dict[str, JobState]
    ) -> None:
        """The status while nothing but the compose Job is at work."""
        memory.notice(jobs)
        key = (accepted.identity.namespace, accepted.identity.name)
        again = await self._diagnosis.update(accepted, memory, jobs)
        self._queue.add(key, again or self._settings.stall_seconds)
        obj = self._store.campaigns[key]
        old = CampaignStatus.model_validate(obj.get("status") or {})
        trouble = memory.trouble
        reason, message = (trouble.reason, trouble.message) if trouble else ("Composing", "")
        conditions = [
            c.model_copy(update={"status": status, "reason": reason, "message": message})
            for c, status in zip(
                rejected_conditions(
                    reason,
                    message,
                    obj["metadata"]["generation"],
                    format_time(now()),
                    old.conditions,
                ),
                ("Unknown", "True", "True" if trouble else "False", *["Unknown"] * 4),
                strict=True,
            )
        ]
        status = CampaignStatus(
            observed_generation=obj["metadata"]["generation"],
            state="Composing",
            campaign=accepted.campaign,
            bucket=accepted.bucket,
            endpoint=accepted.endpoint,
            image=accepted.image,
            conditions=conditions,
        )
        await self._write_status(obj, status, memory)

    async def _make_inputs(self, accepted: Accepted, memory: Memory) -> None:
        """The inline files, where pods can mount them."""
        if not memory.files_made:
            config_map = files_config_map(accepted)
            if config_map is not None:
                await self._api.create(paths.config_maps(accepted.identity.namespace), config_map)
            memory.files_made = True

    async def _additions(self, obj: Object, accepted: Accepted) -> Additions:
        """The document's own Configurations are made; those applied by hand are read."""
        identity = accepted.identity
        key = (identity.namespace, identity.name)
        there = self._store.configurations_of(key)
        names = {item["metadata"]["name"] for item in there}
        for wanted in own_configurations(accepted):
            if wanted["metadata"]["name"] not in names:
                made = await self._api.create(paths.configurations(identity.namespace), wanted)
                if made is not None:
                    self._store.configurations[identity.namespace, made["metadata"]["name"]] = made
        added = [
            item
            for item in there
            if not is_own(item, identity) and "deletionTimestamp" not in item["metadata"]
        ]
        if not added:
            return Additions()
        files = await self._files(obj)
        return await asyncio.to_thread(
            with_additions,
            obj,
            accepted,
            added,
            files if not isinstance(files, Rejected) else None,
            self._settings,
        )

    async def _revisions(
        self, accepted: Accepted, additions: Additions, memory: Memory
    ) -> Sequence[Revision]:
        """The campaign's plans, with one more when more is asked for."""
        memory.problems = dict(additions.problems)
        if memory.revisions is None:
            memory.revisions = await self._load_revisions(accepted.identity)
        name = accepted.identity.child(f"plan-{len(memory.revisions)}")
        new = next_revision(accepted, memory.revisions, additions.found, name)
        if new is not None:
            told = additions.accepted or accepted
            if not await self._create_plan(told, new, new.entries):
                memory.revisions = None  # another replica was faster: read what it wrote
                return await self._revisions(accepted, additions, memory)
            memory.revisions.append(new)
        return memory.revisions

    async def _load_revisions(self, identity: Identity) -> list[Revision]:
        selector = ",".join(f"{name}={value}" for name, value in identity.labels.items())
        found = self._api.list(paths.config_maps(identity.namespace), labelSelector=selector)
        return read_revisions([obj async for obj in found], identity.child("plan-"))

    async def _create_plan(
        self, accepted: Accepted, revision: Revision, entries: tuple[Entry, ...]
    ) -> bool:
        plan = revision.plan if revision.number >= 0 else None
        obj = plan_config_map(accepted, revision.config_map, plan, entries)
        obj["metadata"]["annotations"] = owners_note(revision)
        made = await self._api.create(paths.config_maps(accepted.identity.namespace), obj)
        return made is not None

    async def _carry_out(
        self, obj: Object, accepted: Accepted, decision: Decision, memory: Memory
    ) -> None:
        """Act, then remember in the status, then remove what is remembered there."""
        for action in decision.actions:
            await self._act(accepted, action)
        written = await self._write_status(obj, decision.status, memory)
        if not written:
            return
        for action in decision.later:
            await self._act(accepted, action)

    async def _act(self, accepted: Accepted, action: Action) -> None:
        namespace = accepted.identity.namespace
        match action:
            case CreateShard(shard):
                await self._create_job(shard_job(accepted, self._settings, shard))
            case CreateTask(command, name, plan):
                await self._create_job(task_job(accepted, self._settings, command, name, plan))
            case SuspendJob(job, suspend):
                await self._suspend(accepted, job, suspend)
            case ResizeJob(job, parallelism):
                patch = {"spec": {"parallelism": parallelism}}
                self._saw(await self._api.patch(f"{paths.jobs(namespace)}/{job}", patch))
            case DeleteJob(job):
                await self._api.delete(f"{paths.jobs(namespace)}/{job}")

    async def _suspend(self, accepted: Accepted, job: str, suspend: bool) -> None:
        """Stop or resume a Job; one that Kueue has admitted is taken from it."""
        namespace = accepted.identity.namespace
        if accepted.spec.queue_name is None:
            patch: Object = {"spec": {"suspend": suspend}}
            self._saw(await self._api.patch(f"{paths.jobs(namespace)}/{job}", patch))
            return
        await self._diagnosis.activate(accepted, job, active=not suspend)

    async def _create_job(self, job: Object) -> None:
        """Make a Job and know it at once, as if it had been seen."""
        self._saw(await self._api.create(paths.jobs(job["metadata"]["namespace"]), job))

    def _saw(self, job: Object | None) -> None:
        if job is not None:
            self._store.put_job(JobState.of(job))

    async def _reject(self, obj: Object, rejected: Rejected) -> None:
        generation = obj["metadata"]["generation"]
        old = CampaignStatus.model_validate(obj.get("status") or {})
        conditions = rejected_conditions(
            rejected.reason, rejected.message, generation, format_time(now()), old.conditions
        )
        status = old.model_copy(
            update={
                "observed_generation": generation,
                "state": "Rejected",
                "conditions": conditions,
            }
        )
        key = (obj["metadata"]["namespace"], obj["metadata"]["name"])
        await self._write_status(obj, status, self._memories[key])

    async def _write_status(self, obj: Object, status: CampaignStatus, memory: Memory) -> bool:
        """Write a status that has changed; False when it is put off."""
        old = CampaignStatus.model_validate(obj.get("status") or {})
        if status == old:
            return True
        identity = Identity.of(obj)
        wait = memory.status_written + self._settings.status_seconds - time.monotonic()
        if wait > 0 and not is_news(old, status):
            self._queue.add((identity.namespace, identity.name), wait)
            return False
        path = f"{paths.campaigns(identity.namespace)}/{identity.name}"
        body = {
            "apiVersion": API_VERSION,
            "kind": "Campaign",
            "metadata": {"name": identity.name, "uid": identity.uid},
            "status": compact(status.model_dump(by_alias=True, exclude_none=True)),
        }
        written = await self._api.apply_status(path, body)
        memory.status_written = time.monotonic()
        if written is not None:
            self._store.put_campaign(written)
        for message in messages(old.conditions, status.conditions):
            told = event(identity, message, format_time(now()))
            await self._api.create(paths.events(identity.namespace), told)
        return True

    async def _tell_configurations(
        self,
        obj: Object,
        accepted: Accepted,
        revision: Revision,
        status: CampaignStatus,
        memory: Memory,
    ) -> None:
        """Write the Configurations' statuses: at their beginning and at the campaign's end."""
        del obj
        ended = is_true(status, "ResultsAvailable")
        key = (accepted.identity.namespace, accepted.identity.name)
        for item in self._store.configurations_of(key):
            name = item["metadata"]["name"]
            seen = (item.get("status") or {}).get("observedGeneration")
            if not ended and seen == item["metadata"].get("generation"):
                continue
            told = configuration_status(
                item, revision, status, format_time(now()), memory.problems.get(name, "")
            )
            await self._write_configuration_status(item, told)

    async def _write_configuration_status(self, item: Object, told: Any) -> None:
        body = compact(told.model_dump(by_alias=True, exclude_none=True))
        if body == (item.get("status") or {}):
            return
        meta = item["metadata"]
        path = f"{paths.configurations(meta['namespace'])}/{meta['name']}"
        written = await self._api.apply_status(
            path,
            {
                "apiVersion": API_VERSION,
                "kind": "Configuration",
                "metadata": {"name": meta["name"], "uid": meta["uid"]},
                "status": body,
            },
        )
        if written is not None:
            self._store.configurations[meta["namespace"], meta["name"]] = written

    async def _deleted(self, obj: Object, memory: Memory, jobs: dict[str, JobState]) -> None:
        """A Campaign that is being deleted; only `retention: Delete` leaves anything to do."""
        accepted = await self._accepted(obj, memory)
        again = await self._purge.carry_out(obj, accepted, jobs)
        if again is not None:
            self._queue.add((obj["metadata"]["namespace"], obj["metadata"]["name"]), again)

"""One reconcile of a Campaign: observe, decide, act. Effects only; what to do is `decide`."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence

from robovast.base.errors import RobovastError
from robovast.kubeapi.share_job import ROLE as SHARE_ROLE
from robovast.kubeapi.status import CampaignStatus, read_status
from robovast.storage.folder_ownership import distinct_name
from robovast_operator.decide import (
    Action,
    AppendRuns,
    CampaignDecision,
    CreateShard,
    CreateTask,
    CreateUpload,
    DeleteJob,
    DeletePlan,
    ResizeJob,
    SuspendJob,
    decide,
)
from robovast_operator.effects.deliveries import Deliveries
from robovast_operator.effects.diagnose import PATIENCE, Diagnosis
from robovast_operator.effects.inputs import UNWATCHED, Inputs, NotYetError
from robovast_operator.effects.job_maker import JobMaker
from robovast_operator.effects.jobs import Jobs
from robovast_operator.effects.namespace_limits import NamespaceLimitsReader
from robovast_operator.effects.notifier import Notifier
from robovast_operator.effects.own_pods import LOOK_SECONDS, OwnPods
from robovast_operator.effects.pod_facts import Witness
from robovast_operator.effects.purge import Purge
from robovast_operator.effects.queues import Queues
from robovast_operator.effects.status_writer import Statuses
from robovast_operator.kube import paths
from robovast_operator.kube.announce import is_refusal
from robovast_operator.kube.api import PAUSE, Api, ApiError
from robovast_operator.kube.conditions import is_true
from robovast_operator.kube.metrics import Metrics
from robovast_operator.kube.objects import Identity, Key, Object
from robovast_operator.kube.store import JobState, Store
from robovast_operator.kube.times import now
from robovast_operator.kube.untrusted_fields import mapping
from robovast_operator.kube.work_queue import REFUSED_DELAY, WorkQueue
from robovast_operator.memory import Memory
from robovast_operator.planning.accept import DOCUMENT_CHANGED, with_composition
from robovast_operator.planning.additions import Additions
from robovast_operator.planning.campaign import Accepted, Rejected, Revision
from robovast_operator.planning.configurations import NOT_FOUND
from robovast_operator.planning.proposals import first_plan
from robovast_operator.pods.job_attempts import TASK_PODS_LOST, Tries
from robovast_operator.pods.jobs import shard_job, task_job, upload_job
from robovast_operator.pods.observations import Trouble
from robovast_operator.pods.pod_status import trouble_of
from robovast_operator.pods.reports import composed_of, given_up_of, proposed_of
from robovast_operator.settings import OperatorSettings
from robovast_operator.snapshot import Snapshot
from robovast_operator.status.conditions import is_settled
from robovast_operator.status.failures import trouble_of_error
from robovast_operator.status.progress_events import progress_events
from robovast_operator.status.status import campaign_status

LOGGER = logging.getLogger(__name__)


class Reconciler:
    """Brings the objects of campaigns into the wanted state."""

    def __init__(
        self, api: Api, store: Store, queue: WorkQueue, settings: OperatorSettings, metrics: Metrics
    ) -> None:
        self._api = api
        self._metrics = metrics
        self._store = store
        self._queue = queue
        self._settings = settings
        self._memories: dict[Key, Memory] = {}
        self._inputs = Inputs(api, store, settings, queue.add)
        self._queues = Queues(api, store, settings)
        limits = NamespaceLimitsReader(api)
        created = Jobs(api, store, limits)
        self._diagnosis = Diagnosis(api, settings, self._queues, limits)
        self._own_pods = OwnPods(api)
        self._witness = Witness(api, self._diagnosis)
        self._deliveries = Deliveries(api, self._diagnosis)
        notifier = Notifier(queue, settings)
        put_off = metrics.put_off.inc
        self._statuses = Statuses(api, store, queue, settings, notifier, created, put_off)
        self._job_maker = JobMaker(api, store, created)
        self._purge = Purge(api, settings, self._diagnosis, created)

    def forget(self) -> None:
        """Forget cached data of campaigns, because another replica may have changed them."""
        for key in list(self._memories):
            self._forget(key)

    def _forget(self, key: Key) -> None:
        if key in self._memories:
            self._memories.pop(key).inputs.cancel()

    async def __call__(self, key: Key) -> None:
        """Reconcile a Campaign; a failure is logged, reported, and tried again later."""
        try:
            await self._reconcile(key)
        except NotYetError:
            return
        except (TimeoutError, ApiError, OSError, RobovastError) as error:
            delay = self._queue.add_failed(key, REFUSED_DELAY)
            LOGGER.warning("%s/%s: %s; again in %.0f s", *key, error, delay)
            if isinstance(error, ApiError) and error.terminating:
                await self._let_go(key)
            else:
                await self._report_failure(key, trouble_of_error(error))
        except Exception as error:
            delay = self._queue.add_failed(key)
            LOGGER.exception("%s/%s: a fault of the operator; again in %.0f s", *key, delay)
            await self._report_failure(key, trouble_of_error(error))
        else:
            self._queue.succeeded(key)
            if key in self._memories:
                self._memories[key].failing = None

    async def _report_failure(self, key: Key, trouble: Trouble) -> None:
        """Report why a Campaign cannot be reconciled, if reconciles fail repeatedly."""
        self._metrics.failed(trouble.reason)
        obj, memory = self._store.campaigns.get(key), self._memories.get(key)
        if obj is None or memory is None or "deletionTimestamp" in obj["metadata"]:
            return
        memory.failing = memory.failing or time.monotonic()
        if time.monotonic() - memory.failing < self._settings.stall_seconds:
            return
        try:
            await self._statuses.failing(obj, trouble)
        except (TimeoutError, ApiError, OSError) as error:
            LOGGER.warning("%s/%s: its status cannot be written: %s", *key, error)

    async def _let_go(self, key: Key) -> None:
        """Delete the Jobs of a namespace that is being deleted: Jobs may hold the last pods."""
        try:
            for name in list(self._store.jobs.get(key, {})):
                await self._api.delete(f"{paths.jobs(key[0])}/{name}", after_children=False)
            obj = self._store.campaigns.get(key)
            if obj is not None:
                await self._purge.give_up(obj)
        except ApiError as error:
            LOGGER.warning("%s/%s: %s", *key, error)

    async def _reconcile(self, key: Key) -> None:
        obj = self._store.campaigns.get(key)
        if obj is None:
            self._forget(key)
            await self._statuses.waiting(key, NOT_FOUND)
            return
        identity = Identity.of(obj)
        memory = self._memory(key, identity, obj)
        deliveries = {job.name: job for job in self._store.deliveries_of(key, identity.uid)}
        jobs = self._store.jobs_of(key, identity.uid)
        judged = await self._own_pods.judge({**jobs, **deliveries}, memory.pods)
        jobs = {name: judged[name] for name in jobs}
        if memory.pods.foreign:
            self._queue.add(key, LOOK_SECONDS)  # the Job does not change when our containers end
        if "deletionTimestamp" in obj["metadata"]:
            await self._deleted(obj, memory, jobs)
            return
        if (obj.get("status") or {}).get("bucket"):  # `kubectl replace` leaves no finalizer
            await self._purge.protect(obj)
        sent = [judged[name] for name in deliveries]
        await self._deliveries.report(identity, sent, memory.delivered)
        if not is_settled(obj, jobs, self._store.configurations_of(key)) or self._moved(obj):
            await self._advance(obj, memory, jobs)

    def _moved(self, obj: Object) -> bool:
        """Return whether a Campaign's status shows another S3 server than the current one."""
        storage = mapping(mapping(obj.get("spec")).get("storage"))
        current = storage.get("endpoint") or self._settings.endpoint
        return mapping(obj.get("status")).get("endpoint") not in {None, current}

    def _memory(self, key: Key, identity: Identity, obj: Object) -> Memory:
        memory = self._memories.get(key)
        if memory is None or memory.uid != identity.uid:
            self._forget(key)
            memory = self._memories[key] = Memory(identity.uid)
            status = read_status(CampaignStatus, obj.get("status"))
            if is_true(status, "Stalled"):  # a new leader need not wait to find that again
                memory.pods.motion.expect_stall(PATIENCE * self._settings.stall_seconds)
        return memory

    async def _advance(self, obj: Object, memory: Memory, jobs: dict[str, JobState]) -> None:
        accepted = await self._inputs.accepted(obj, memory.inputs)
        if isinstance(accepted, Accepted):
            await self._purge.protect(obj)
            if not await self._inputs.make_files(accepted, memory.inputs):
                accepted = await self._inputs.accepted(obj, memory.inputs)
        if isinstance(accepted, Accepted):
            await self._job_maker.replace_moved(accepted, jobs)
        if isinstance(accepted, Accepted) and not (accepted.pure or accepted.entries):
            composed = await self._composed(obj, accepted, memory, jobs)
            if composed is None:
                return
            accepted = composed
        if isinstance(accepted, Rejected):
            await self._reject(obj, accepted, memory, jobs)
            if accepted.reason in UNWATCHED:
                later = min(300.0, max(10.0, memory.pods.motion.still_for() / 2))
                self._queue.add((obj["metadata"]["namespace"], obj["metadata"]["name"]), later)
            return
        await self._execute(obj, accepted, memory, jobs)

    async def _reject(
        self, obj: Object, why: Rejected, memory: Memory, jobs: dict[str, JobState]
    ) -> None:
        """Report why a Campaign is rejected, and how the runs are that were planned earlier."""
        planned = await self._inputs.as_planned(obj, memory.inputs) if jobs else None
        if planned is None:
            await self._statuses.rejected(obj, why)
            return
        snapshot = await self._look(obj, *planned, memory, jobs)
        seen = campaign_status(snapshot, ())
        await self._statuses.rejected(obj, why, seen, runs_continue=bool(snapshot.open))
        if snapshot.pods.again is not None:
            self._queue.add(Identity.of(obj).key, snapshot.pods.again)

    async def _execute(
        self, obj: Object, accepted: Accepted, memory: Memory, jobs: dict[str, JobState]
    ) -> None:
        """Return bring an accepted campaign further."""
        cache = memory.inputs
        additions = await self._inputs.additions(obj, accepted, cache)
        revisions = await self._inputs.revisions(accepted, additions, cache)
        if not self._inputs.is_as_planned(obj, accepted, revisions[0], cache):
            await self._reject(obj, DOCUMENT_CHANGED, memory, jobs)
            return
        snapshot = await self._look(obj, accepted, revisions, memory, jobs)
        decision = decide(snapshot)
        await self._carry_out(obj, snapshot, decision, memory)
        status = decision.status
        await self._show_configurations(obj, accepted, revisions[-1], status, additions)
        foreign = REFUSED_DELAY if memory.taken else None  # no watch reports foreign Jobs
        for delay in (snapshot.pods.again, snapshot.queue.again, decision.again, foreign):
            if delay is not None:
                self._queue.add(accepted.identity.key, delay)

    async def _look(
        self,
        obj: Object,
        accepted: Accepted,
        revisions: Sequence[Revision],
        memory: Memory,
        jobs: dict[str, JobState],
    ) -> Snapshot:
        """Observe a campaign."""
        status = read_status(CampaignStatus, obj.get("status"))
        pods = await self._diagnosis.findings(accepted, memory.pods, jobs)
        await self._witness.update(accepted, memory.witnessed, jobs)
        suspended = accepted.spec.suspend
        motion = memory.pods.motion
        queue = await self._queues.findings(memory.queue, motion, jobs, suspended=suspended)
        foreign = await self._job_maker.look_again(accepted.identity, memory.taken)
        return Snapshot(
            accepted=accepted,
            generation=obj["metadata"]["generation"],
            status=status,
            revisions=revisions,
            jobs=jobs,
            now=now(),
            pods=pods,
            queue=queue,
            taken=frozenset(memory.taken),
            foreign=foreign,
            variant_limit=self._settings.variant_limit,
            withdrawn=await self._inputs.withdrawn(accepted, revisions, memory.inputs),
        )

    async def _show_configurations(
        self,
        obj: Object,
        accepted: Accepted,
        revision: Revision,
        status: CampaignStatus,
        additions: Additions,
    ) -> None:
        """Create and update Configurations; runs do not wait for a rejected Configuration."""
        identity = accepted.identity
        try:
            await self._inputs.make_configurations(accepted)
            await self._statuses.configurations(accepted, revision, status, additions)
        except ApiError as error:
            if error.terminating or error.code == 0:
                raise
            trouble = trouble_of_error(error)
            LOGGER.warning("%s/%s: %s", identity.namespace, identity.name, trouble.message)
            self._metrics.failed(trouble.reason)
            await self._statuses.report(identity, trouble, obj["metadata"]["generation"])
            self._queue.add(identity.key, REFUSED_DELAY)

    async def _composed(
        self, obj: Object, accepted: Accepted, memory: Memory, jobs: dict[str, JobState]
    ) -> Accepted | Rejected | None:
        """Return the campaign with the result of its compose Job; None while the Job runs."""
        identity = accepted.identity
        planned = await self._inputs.planned(accepted, memory.inputs)
        if planned is not None:
            return planned
        command = "propose" if accepted.is_search else "compose"
        task = "propose-0" if accepted.is_search else "compose"
        tries = Tries.of(jobs.values(), identity.child(task))
        ended = tries.last is not None and bool(tries.last.finished)
        if tries.last is not None and ended:
            found = await self._composition(accepted, tries.last, memory)
            if found is not None:
                return found
        if tries.last is None or (ended and not tries.wait(now())):
            plan = identity.child("plan-compose")
            await self._inputs.prepare_composing(accepted, plan)
            name = tries.next_name
            composing = task_job(accepted, self._settings, command, name, plan)
            await self._job_maker.create(identity, composing, memory.taken)
        for job in tries.old:
            await self._api.delete(f"{paths.jobs(identity.namespace)}/{job.name}")
        pods = await self._diagnosis.findings(accepted, memory.pods, jobs)
        again = pods.again or self._settings.stall_seconds
        self._queue.add(identity.key, REFUSED_DELAY if memory.taken else again)
        lost_pods = Trouble(TASK_PODS_LOST, tries.problem) if ended and tries.problem else None
        foreign = await self._job_maker.look_again(identity, memory.taken)
        await self._statuses.composing(obj, accepted, foreign or lost_pods or pods.trouble)
        return None

    async def _composition(
        self, accepted: Accepted, job: JobState, memory: Memory
    ) -> Accepted | Rejected | None:
        """Return the campaign with the result of an ended compose Job; None without pods."""
        pods = [pod async for pod in self._diagnosis.pods_of(job)]
        if not pods:
            return None
        given_up = given_up_of(job.namespace, job.name, pods)
        if given_up is not None:
            return Rejected(given_up.reason, given_up.message)
        found = trouble_of(pods)
        reason = found.reason if found is not None and found.final else "InvalidDocument"
        limit = self._settings.variant_limit
        if not accepted.is_search:
            return with_composition(accepted, composed_of(pods), limit, reason)
        name = accepted.identity.child("plan-0")
        first = first_plan(accepted, proposed_of(pods), name, limit, reason)
        if isinstance(first, Rejected):
            return first
        await self._inputs.append(accepted, first, memory.inputs)
        return await self._inputs.planned(accepted, memory.inputs)

    async def _carry_out(
        self, obj: Object, snapshot: Snapshot, decision: CampaignDecision, memory: Memory
    ) -> None:
        """Act, then write the status, then remove what the status keeps.

        If an action is refused, the counts of the status stay current all the same.
        """
        accepted = snapshot.accepted
        try:
            for action in decision.actions:
                await self._act(accepted, action, memory)
        except ApiError as error:
            if is_refusal(error):
                seen, old = campaign_status(snapshot, ()), snapshot.status
                kept = {"conditions": old.conditions or seen.conditions, "state": old.state}
                events = tuple(progress_events(snapshot, seen))
                await self._statuses.write(obj, seen.model_copy(update=kept), events)
            raise
        written = await self._statuses.write(obj, decision.status, decision.events)
        if not written:
            return
        for action in decision.later:
            await self._act(accepted, action, memory)

    async def _act(self, accepted: Accepted, action: Action, memory: Memory) -> None:
        namespace = accepted.identity.namespace
        match action:
            case CreateShard(shard):
                made = shard_job(accepted, self._settings, shard)
                await self._job_maker.create(accepted.identity, made, memory.taken)
            case CreateTask("finish" | "propose", beside=beside) if await self._diagnosis.hold_back(
                accepted.identity, memory.pods, beside
            ):
                self._queue.add((namespace, accepted.identity.name), PAUSE)
            case CreateTask(command, name, plan):
                seen = await self._witness.kept(accepted) if command == "finish" else ()
                made = task_job(accepted, self._settings, command, name, plan, seen)
                await self._job_maker.create(accepted.identity, made, memory.taken)
            case CreateUpload(name):
                await self._end_other_uploads(accepted.identity, name)
                made = upload_job(accepted, self._settings, name, self._archive(accepted))
                await self._job_maker.create(accepted.identity, made, memory.taken)
            case AppendRuns(plan):
                await self._inputs.append(accepted, plan, memory.inputs)
                self._queue.add(accepted.identity.key)
            case SuspendJob(job, suspend):
                await self._suspend(accepted, job, suspend, memory)
            case ResizeJob(job, parallelism):
                patch = {"spec": {"parallelism": parallelism}}
                self._saw(await self._api.patch(f"{paths.jobs(namespace)}/{job}", patch))
            case DeleteJob(job):
                await self._api.delete(f"{paths.jobs(namespace)}/{job}")
            case DeletePlan(config_map):
                await self._inputs.remove_plan(accepted.identity, config_map, memory.inputs)

    async def _end_other_uploads(self, identity: Identity, name: str) -> None:
        """End uploads of earlier results, which could take the place of newer ones."""
        for job in self._store.deliveries_of(identity.key, identity.uid):
            if job.role == SHARE_ROLE and job.open and job.name != name:
                await self._api.delete(f"{paths.jobs(identity.namespace)}/{job.name}")

    def _archive(self, accepted: Accepted) -> str:
        """Name of the results outside of the cluster; unique even for equal names and seconds."""
        identity = accepted.identity
        alike = [
            found
            for key, found in self._store.campaigns.items()
            if key != identity.key  # of any namespace: several may have one share
            and (found.get("status") or {}).get("campaign") == accepted.campaign
        ]
        return distinct_name(accepted.campaign, identity.uid) if alike else accepted.campaign

    async def _suspend(self, accepted: Accepted, name: str, suspend: bool, memory: Memory) -> None:
        """Stop or resume a Job; ask Kueue if Kueue manages the Job."""
        identity = accepted.identity
        jobs = self._store.jobs_of(identity.key, identity.uid)
        if name in jobs and not await self._queues.park(jobs[name], memory.queue, parked=suspend):
            patch: Object = {"spec": {"suspend": suspend}}
            self._saw(await self._api.patch(f"{paths.jobs(identity.namespace)}/{name}", patch))

    def _saw(self, job: Object | None) -> None:
        if job is not None:
            self._store.put_job(JobState.of(job))

    async def _deleted(self, obj: Object, memory: Memory, jobs: dict[str, JobState]) -> None:
        """Reconcile a Campaign that is being deleted; only `retention: Delete` has work to do."""
        if not self._purge.holds(obj):
            return
        begun = await self._inputs.begun(obj, memory.inputs)
        if not isinstance(begun, Rejected):
            await self._job_maker.replace_moved(begun[0], jobs)
        again = await self._purge.carry_out(obj, begun, jobs)
        if again is not None:
            self._queue.add((obj["metadata"]["namespace"], obj["metadata"]["name"]), again)

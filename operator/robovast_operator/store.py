"""What the operator knows of the cluster: small facts, kept up to date by watch events."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from robovast.cluster.resources import CAMPAIGN_LABEL, SHARD_LABEL, UID_LABEL
from robovast_operator.campaign import Key, Object

ROLE_LABEL = "robovast.io/role"
"""`shard`, `compose`, `finish` or `purge`, on Jobs and pods."""

RUNS_ANNOTATION = "robovast.io/runs"
"""Ids of the runs that a Job executes once more."""

QUEUE_LABEL = "kueue.x-k8s.io/queue-name"
"""Of a Job: the LocalQueue that it stands in."""

ATTEMPT_ANNOTATION = "robovast.io/attempt"
"""Which attempt a Job belongs to."""


@dataclass(frozen=True, slots=True)
class JobState:
    """What matters of a Job."""

    namespace: str
    name: str
    uid: str
    campaign: str
    campaign_uid: str
    role: str
    shard: int
    """Number of the shard; -1 of another Job."""
    runs: str
    """Ids of the runs that it executes once more; empty for a first attempt."""
    attempt: int
    resource_version: str
    parallelism: int
    suspended: bool
    active: int
    ready: int
    failed_pods: int
    completed: str
    """Completed indexes as ranges."""
    failed: str
    """Failed indexes as ranges."""
    finished: str
    """`Complete`, `Failed`, or empty."""
    reason: str
    message: str
    deleting: bool
    size: int = 1
    """Number of completion indexes."""
    queue: str = ""
    """Kueue's LocalQueue that it stands in; Kueue may have chosen one itself."""
    started: str = ""
    """When its pods were last allowed to start; empty while they are not."""

    @property
    def key(self) -> Key:
        """The Campaign that it belongs to."""
        return self.namespace, self.campaign

    @property
    def open(self) -> bool:
        """Whether it may still change."""
        return not self.finished

    @classmethod
    def of(cls, obj: Object) -> JobState:
        """The facts of a Job object."""
        meta, spec, status = obj["metadata"], obj.get("spec", {}), obj.get("status") or {}
        labels = meta.get("labels") or {}
        end = _end(status.get("conditions") or ())
        return cls(
            namespace=meta["namespace"],
            name=meta["name"],
            uid=meta["uid"],
            campaign=labels.get(CAMPAIGN_LABEL, ""),
            campaign_uid=labels.get(UID_LABEL, ""),
            role=labels.get(ROLE_LABEL, ""),
            shard=int(labels.get(SHARD_LABEL, "-1")),
            runs=(meta.get("annotations") or {}).get(RUNS_ANNOTATION, ""),
            attempt=int((meta.get("annotations") or {}).get(ATTEMPT_ANNOTATION, "1")),
            resource_version=meta["resourceVersion"],
            parallelism=spec.get("parallelism", 1),
            suspended=bool(spec.get("suspend")),
            active=status.get("active", 0),
            ready=status.get("ready", 0),
            failed_pods=status.get("failed", 0),
            completed=status.get("completedIndexes", ""),
            failed=status.get("failedIndexes", ""),
            finished=end.get("type", ""),
            reason=end.get("reason", ""),
            message=end.get("message", ""),
            deleting="deletionTimestamp" in meta,
            size=spec.get("completions", 1),
            queue=labels.get(QUEUE_LABEL, ""),
            started=status.get("startTime", ""),
        )


def _end(conditions: Iterable[Object]) -> Object:
    """The condition that ended a Job, or nothing."""
    ends = (c for c in conditions if c["type"] in {"Complete", "Failed"} and c["status"] == "True")
    return next(ends, {})


@dataclass
class Store:
    """Campaigns, Configurations and Jobs by namespace and name."""

    campaigns: dict[Key, Object] = field(default_factory=dict)
    configurations: dict[Key, Object] = field(default_factory=dict)
    jobs: dict[Key, dict[str, JobState]] = field(default_factory=dict)
    """By namespace and name of their Campaign, then by their own name."""

    def put_campaign(self, obj: Object) -> bool:
        """Know a Campaign as it is now; False when something newer is known."""
        meta = obj["metadata"]
        key = (meta["namespace"], meta["name"])
        known = self.campaigns.get(key)
        same = known is not None and known["metadata"]["uid"] == meta["uid"]
        if known is not None and same and not _newer(_version(obj), _version(known)):
            return False
        meta.pop("managedFields", None)  # a third of the object, and of no use here
        self.campaigns[key] = obj
        return True

    def put_job(self, job: JobState) -> None:
        """Know a Job as it is now; what is older than what is known is ignored."""
        jobs = self.jobs.setdefault(job.key, {})
        known = jobs.get(job.name)
        same = known is not None and known.uid == job.uid
        if not same or known is None or _newer(job.resource_version, known.resource_version):
            jobs[job.name] = job

    def drop_job(self, job: JobState) -> None:
        """Forget a Job; its successor of the same name stays."""
        jobs = self.jobs.get(job.key, {})
        known = jobs.get(job.name)
        if known is not None and known.uid == job.uid:
            del jobs[job.name]
        if not jobs:
            self.jobs.pop(job.key, None)

    def jobs_of(self, key: Key, uid: str) -> dict[str, JobState]:
        """The Jobs of a Campaign by name, those of a predecessor of its name left out."""
        jobs = self.jobs.get(key, {})
        return {name: job for name, job in jobs.items() if job.campaign_uid == uid}

    def configurations_of(self, key: Key) -> list[Object]:
        """The Configurations of a Campaign, oldest first."""
        namespace, name = key
        found = [
            obj
            for (space, _), obj in self.configurations.items()
            if space == namespace and obj["spec"].get("campaign") == name
        ]
        return sorted(
            found, key=lambda o: (o["metadata"]["creationTimestamp"], o["metadata"]["name"])
        )


def _version(obj: Object) -> str:
    return str(obj["metadata"]["resourceVersion"])


def _newer(one: str, other: str) -> bool:
    """Whether a resource version is not older; they are numbers on every server we know."""
    return not (one.isdigit() and other.isdigit()) or int(one) >= int(other)

"""The store of watched objects, reduced to the fields that matter, updated by watch events."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from robovast.base.ranges import count
from robovast.kubeapi.names import child_name
from robovast.kubeapi.pod_contract.storage_address import ENDPOINT, REGION, joined_address
from robovast.kubeapi.resources import CAMPAIGN_LABEL, ROLE_LABEL, UID_LABEL
from robovast.kubeapi.share_job import ROLE as SHARE_ROLE
from robovast_operator.kube.objects import Key, Object
from robovast_operator.kube.untrusted_fields import (
    BEGINNING,
    mapping,
    mappings,
    metadata,
    number,
    ranges,
    shaped,
    text,
    time,
)

NOTIFY_ROLE = "notify"
"""Role of Jobs that send a notice."""
_DELIVERIES = {NOTIFY_ROLE, SHARE_ROLE}
"""Roles of Jobs that bring something out of the cluster: nothing in a campaign depends on them."""

QUEUE_LABEL = "kueue.x-k8s.io/queue-name"
"""Label of a Job: its LocalQueue."""

_JOB_CONTROLLER = "kubernetes.io/job-controller"
"""Value of `spec.managedBy` of a Job whose pods are in the cluster of the Job."""

PRIORITY_LABEL = "kueue.x-k8s.io/priority-class"
"""Label of a Job: its WorkloadPriorityClass of Kueue."""

CONFIGURATION_LABEL = "robovast.io/configuration-uid"
"""Label of a Job: the Configuration applied by hand that asked for its runs."""

Id = tuple[str, str, str]
"""Namespace, name and uid of an object."""


@dataclass(frozen=True, slots=True)
class JobState:
    """The fields of a Job that matter."""

    namespace: str
    name: str
    uid: str
    campaign: str
    campaign_uid: str
    role: str
    resource_version: str
    parallelism: int
    suspended: bool
    active: int
    ready: int
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
    """Kueue's LocalQueue of the Job; Kueue may have chosen it itself."""
    priority: str = ""
    """Its WorkloadPriorityClass of Kueue."""
    started: str = ""
    """When the Job was last resumed; empty while it is suspended."""
    configuration: str = ""
    """Uid of the Configuration applied by hand that asked for its runs, if one did."""
    ended: str = BEGINNING
    """When it finished."""
    elsewhere: bool = False
    """Whether its pods are in another cluster, from where Kueue brings its status."""
    address: str = ""
    """The S3 server that its pods use: endpoint and region; empty if they use none."""

    @property
    def key(self) -> Key:
        """Return namespace and name of the Campaign of the Job."""
        return self.namespace, self.campaign

    @property
    def open(self) -> bool:
        """Return whether the Job has not finished."""
        return not self.finished

    @property
    def begun(self) -> bool:
        """Return whether any pod of the Job has been started."""
        return bool(self.active or self.completed or self.failed)

    @property
    def pods(self) -> int:
        """Return the number of open pods; 0 for suspended Jobs of other clusters."""
        return 0 if self.elsewhere and self.suspended else self.active

    @property
    def at_work(self) -> int:
        """Return number of pods whose containers have all started."""
        return min(self.ready, self.pods)

    @property
    def left(self) -> int:
        """Return number of completion indexes that have not ended."""
        return self.size - sum(count(ranges(t, self.size)) for t in (self.completed, self.failed))

    @classmethod
    def of(cls, obj: Object) -> JobState:
        """Extract the fields of a Job object, also from an invalid object."""
        obj = shaped(obj)
        meta, spec, status = obj["metadata"], obj["spec"], obj["status"]
        labels = meta.get("labels", {})
        end = _end(status.get("conditions", ()))
        return cls(
            namespace=meta["namespace"],
            name=meta["name"],
            uid=meta["uid"],
            campaign=labels.get(CAMPAIGN_LABEL, ""),
            campaign_uid=labels.get(UID_LABEL, ""),
            role=labels.get(ROLE_LABEL, ""),
            resource_version=meta["resourceVersion"],
            parallelism=number(spec.get("parallelism"), 1),
            suspended=spec.get("suspend") is True,
            active=number(status.get("active")),
            ready=number(status.get("ready")),
            completed=text(status.get("completedIndexes")),
            failed=text(status.get("failedIndexes")),
            finished=end.get("type", ""),
            reason=end.get("reason", ""),
            message=end.get("message", ""),
            deleting="deletionTimestamp" in meta,
            size=number(spec.get("completions"), 1),
            queue=labels.get(QUEUE_LABEL, ""),
            priority=labels.get(PRIORITY_LABEL, ""),
            started=time(status.get("startTime")) if "startTime" in status else "",
            configuration=labels.get(CONFIGURATION_LABEL, ""),
            ended=time(end.get("lastTransitionTime")),
            elsewhere=text(spec.get("managedBy"), _JOB_CONTROLLER) != _JOB_CONTROLLER,
            address=_address(spec),
        )


def _address(spec: Object) -> str:
    """Return the S3 server that a Job's pods use."""
    pod = mapping(mapping(spec.get("template")).get("spec"))
    variables = [v for c in mappings(pod.get("containers")) for v in mappings(c.get("env"))]
    values = {text(v.get("name")): text(v.get("value")) for v in variables}
    return joined_address(values.get(ENDPOINT, ""), values.get(REGION))


def _end(conditions: Iterable[Object]) -> Object:
    """Return the condition that ended a Job, or an empty condition."""
    ends = (c for c in conditions if c["type"] in {"Complete", "Failed"} and c["status"] == "True")
    return next(ends, {})


@dataclass
class Store:
    """Campaigns, Configurations and Jobs by namespace and name."""

    campaigns: dict[Key, Object] = field(default_factory=dict)
    configurations: dict[Key, Object] = field(default_factory=dict)
    jobs: dict[Key, dict[str, JobState]] = field(default_factory=dict)
    """By namespace and name of their Campaign, then by their own name."""
    _named: dict[Key, dict[str, Object]] = field(default_factory=dict)
    """Configurations by namespace and name of their Campaign, then by their own name."""

    def put_campaign(self, obj: Object) -> bool:
        """Store a Campaign; return False if the store has a newer version."""
        return _put(self.campaigns, obj)

    def drop_campaign(self, id_: Id) -> Object | None:
        """Remove and return a Campaign; a successor of the same name stays."""
        return _drop(self.campaigns, id_)

    def put_configuration(self, obj: Object) -> bool:
        """Store a Configuration; return False if the store has a newer version."""
        namespace, name, _ = id_of(obj)
        stored = self.configurations.get((namespace, name))
        if not _put(self.configurations, obj):
            return False
        if stored is not None:
            self._drop_named(stored)
        key = campaign_of(obj)
        if key[1]:
            self._named.setdefault(key, {})[name] = self.configurations[namespace, name]
        return True

    def drop_configuration(self, id_: Id) -> Object | None:
        """Remove and return a Configuration; a successor of the same name stays."""
        stored = _drop(self.configurations, id_)
        if stored is not None:
            self._drop_named(stored)
        return stored

    def _drop_named(self, configuration: Object) -> None:
        key = campaign_of(configuration)
        named = self._named.get(key, {})
        named.pop(configuration["metadata"]["name"], None)
        if not named:
            self._named.pop(key, None)

    def campaign_versions(self) -> Iterator[tuple[Id, str]]:
        """Return all Campaigns with their resource versions."""
        return ((id_of(obj), _version(obj)) for obj in self.campaigns.values())

    def configuration_versions(self) -> Iterator[tuple[Id, str]]:
        """Return all Configurations with their resource versions."""
        return ((id_of(obj), _version(obj)) for obj in self.configurations.values())

    def job_versions(self) -> Iterator[tuple[Id, str]]:
        """Generate all Jobs with their resource versions."""
        for jobs in self.jobs.values():
            for job in jobs.values():
                yield (job.namespace, job.name, job.uid), job.resource_version

    def put_job(self, job: JobState) -> None:
        """Store a Job; ignore a version that is older than the stored version."""
        jobs = self.jobs.setdefault(job.key, {})
        stored = jobs.get(job.name)
        same = stored is not None and stored.uid == job.uid
        if not same or stored is None or _newer(job.resource_version, stored.resource_version):
            jobs[job.name] = job

    def drop_job(self, id_: Id) -> Key | None:
        """Remove a Job and return its Campaign; a successor of the same name stays."""
        key = self._campaign_of(id_)
        if key is not None:
            del self.jobs[key][id_[1]]
            if not self.jobs[key]:
                del self.jobs[key]
        return key

    def _campaign_of(self, job: Id) -> Key | None:
        """Return the Campaign of a Job; None if the store lacks the Job."""
        namespace, name, uid = job
        return next(
            (
                key
                for key, jobs in self.jobs.items()
                if key[0] == namespace and name in jobs and jobs[name].uid == uid
            ),
            None,
        )

    def has_campaign(self, id_: Id) -> bool:
        """Return whether the store has a Campaign."""
        return _has(self.campaigns, id_)

    def has_configuration(self, id_: Id) -> bool:
        """Return whether the store has a Configuration."""
        return _has(self.configurations, id_)

    def has_job(self, id_: Id) -> bool:
        """Return whether the store has a Job."""
        return self._campaign_of(id_) is not None

    def jobs_of(self, key: Key, uid: str) -> dict[str, JobState]:
        """Return a Campaign's Jobs by name, without Jobs of an earlier namesake."""
        return {j.name: j for j in self._own_jobs(key, uid) if j.role not in _DELIVERIES}

    def deliveries_of(self, key: Key, uid: str) -> list[JobState]:
        """Return the Jobs that send a Campaign's notifications or upload its results."""
        return [job for job in self._own_jobs(key, uid) if job.role in _DELIVERIES]

    def _own_jobs(self, key: Key, uid: str) -> list[JobState]:
        """Return the Jobs that have a Campaign's uid and a name with the Campaign's prefix.

        Anybody may make a Job with its labels: such a one is none of it.
        """
        begin = child_name(key[1], uid, "")
        jobs = self.jobs.get(key, {}).values()
        return [job for job in jobs if job.campaign_uid == uid and job.name.startswith(begin)]

    def configurations_of(self, key: Key) -> list[Object]:
        """Return the Configurations of a Campaign, oldest first."""
        return sorted(
            self._named.get(key, {}).values(),
            key=lambda o: (o["metadata"]["creationTimestamp"], o["metadata"]["name"]),
        )


def id_of(obj: Object) -> Id:
    """Return namespace, name and uid, which identify an object."""
    meta = metadata(obj)
    return text(meta.get("namespace")), text(meta.get("name")), text(meta.get("uid"))


def campaign_of(configuration: Object) -> Key:
    """Return namespace and name of a Configuration's Campaign, which may not exist; else empty."""
    namespace, _, _ = id_of(configuration)
    return namespace, text(mapping(mapping(configuration).get("spec")).get("campaign"))


def _put(objects: dict[Key, Object], given: Object) -> bool:
    obj = shaped(given)
    namespace, name, uid = id_of(obj)
    stored = objects.get((namespace, name))
    same = stored is not None and stored["metadata"]["uid"] == uid
    if stored is not None and same and not _newer(_version(obj), _version(stored)):
        return False
    obj["metadata"].pop("managedFields", None)  # a third of the object, and of no use here
    objects[namespace, name] = obj
    return True


def _has(objects: dict[Key, Object], id_: Id) -> bool:
    stored = objects.get(id_[:2])
    return stored is not None and id_of(stored) == id_


def _drop(objects: dict[Key, Object], id_: Id) -> Object | None:
    return objects.pop(id_[:2]) if _has(objects, id_) else None


def _version(obj: Object) -> str:
    return str(obj["metadata"]["resourceVersion"])


def _newer(one: str, other: str) -> bool:
    """Return whether a resource version is not older; all supported servers use numbers."""
    return not (one.isdecimal() and other.isdecimal()) or (len(one), one) >= (len(other), other)

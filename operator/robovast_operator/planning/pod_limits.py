"""How many pods of runs a campaign may have where the installation limits those of a namespace.

The campaigns of a namespace that stand in no queue share its pods as evenly as what they want
allows (max-min fairness), the oldest first where that leaves a rest. Nobody's pods are ended for
another: who has more than its share makes no further Jobs until it has less. Pure functions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from robovast.kubeapi.resources import SHARD_ROLE
from robovast_operator.kube.lenient import mapping, mappings, number, text
from robovast_operator.kube.objects import Identity, Key, Object
from robovast_operator.kube.store import JobState, Store
from robovast_operator.kube.turns import OTHERS

_ENDED = ("passed", "failed", "errored", "undecided", "notNeeded")
_IDLE = {"Composing", "Failed", "Finished", "Finishing", "Rejected", "Suspended"}
"""States in which a campaign has no runs to execute; it is in another before it has any."""


@dataclass(frozen=True)
class PodLimit:
    """What a campaign is limited to."""

    most: int
    """Pods of runs of all campaigns of its namespace at a time."""
    own: int
    """How many of them it may have now; it keeps those that it has."""
    taken: bool
    """Whether others have all of them, or will: they come before it."""
    has: int = 0
    """How many it has."""
    waiting: tuple[Key, ...] = ()
    """Campaigns of the namespace that have none and wait for some, the oldest first."""

    @property
    def told(self) -> str:
        """Why a campaign that may have none waits."""
        pods = "1 pod" if self.most == 1 else f"{self.most} pods"
        return (
            f"the namespace may have {pods} of runs at a time (`operator.podLimits` of the "
            "installation), and other campaigns have them, or come first; it gets its share as "
            "they end"
        )


@dataclass(frozen=True)
class Claim:
    """What a campaign wants of its namespace's pods, and what it has."""

    wanted: int
    has: int
    stalled: bool = False

    @property
    def stuck(self) -> bool:
        """Whether it takes none until somebody helps it: nobody waits for that."""
        return self.stalled and not self.has


def pod_limit(limits: Mapping[str, int], store: Store, own: Identity) -> PodLimit | None:
    """The limit of a campaign; None if it has none.

    Args:
        limits: most pods of runs at a time, by namespace.
        store: what is known of all campaigns.
        own: the campaign.
    """
    most = most_pods(limits, own.namespace)
    if most is None:
        return None
    claims = _claims(store, own)
    if own.key not in claims:
        return None
    others = sum(claim.has for key, claim in claims.items() if key != own.key)
    wanted = [0 if c.stuck and key != own.key else c.wanted for key, c in claims.items()]
    place = list(claims).index(own.key)
    share = shares(most, wanted)[place]
    return PodLimit(
        most,
        own=max(0, min(share, most - others)),
        taken=others >= most or share < min(1, wanted[place]),
        has=claims[own.key].has,
        waiting=tuple(key for key in claims if _waits(store.campaigns[key])),
    )


def most_pods(limits: Mapping[str, int], namespace: str) -> int | None:
    """Pods of runs that a namespace may have at a time; None where they are not limited.

    A Job has no more packs than that. It keeps its pods until it ends, so that others wait for at
    most four packs (robovast_operator.planning.shards.WINDOW) of a campaign that has all pods.
    """
    return limits.get(namespace, limits.get(OTHERS))


def shares(most: int, wanted: Sequence[int]) -> list[int]:
    """Divide pods as evenly as possible; nobody gets more than is wanted, the first get the rest.

    Args:
        most: pods to divide.
        wanted: how many each wants, the oldest first.
    """
    found = [0] * len(wanted)
    left = most
    modest_first = sorted(range(len(wanted)), key=lambda index: (wanted[index], -index))
    for rank, index in enumerate(modest_first):
        found[index] = min(wanted[index], left // (len(wanted) - rank))
        left -= found[index]
    return found


def _claims(store: Store, own: Identity) -> dict[Key, Claim]:
    """The claims of all campaigns of a namespace that stand in no queue, the oldest first.

    How many packs are left is an estimate, as some have fewer runs. A campaign claims a pod for
    each run for itself: it makes no pods that it has no packs for, and leaves none free.
    """
    among = [obj for (space, _), obj in store.campaigns.items() if space == own.namespace]
    found = {}
    for obj in sorted(among, key=_age):
        identity = Identity.of(obj)
        if mapping(obj.get("spec")).get("queueName") is None:
            jobs = store.jobs_of(identity.key, identity.uid).values()
            size = 1 if identity.key == own.key else _runs_of_a_pack(mapping(obj.get("spec")))
            found[identity.key] = Claim(_wanted(obj, size), sum(map(_pods, jobs)), _is_stalled(obj))
    return found


def _waits(obj: Object) -> bool:
    return text(mapping(obj.get("status")).get("state")) == "Queued"


def _is_stalled(obj: Object) -> bool:
    found = mappings(mapping(obj.get("status")).get("conditions"))
    return any(c.get("type") == "Stalled" and c.get("status") == "True" for c in found)


def _age(obj: Object) -> tuple[str, str]:
    meta = obj["metadata"]
    return text(meta.get("creationTimestamp")), text(meta.get("name"))


def _wanted(obj: Object, size: int) -> int:
    """How many pods a campaign can use: not more than it has packs of some size left."""
    spec, status = mapping(obj.get("spec")), mapping(obj.get("status"))
    going = "deletionTimestamp" in obj["metadata"]
    if spec.get("suspend") is True or going or text(status.get("state")) in _IDLE:
        return 0
    runs: Mapping[str, Any] = mapping(status.get("runs"))
    most, total = number(spec.get("parallelism"), 1), number(runs.get("total"))
    left = total - sum(number(runs.get(key)) for key in _ENDED)
    return max(0, min(most, -(-left // size))) if total else most


def _runs_of_a_pack(spec: Object) -> int:
    """Most runs of a pack: all of a configuration where verdicts decide how many are needed."""
    execution = mapping(mapping(spec.get("vast")).get("execution"))
    runs = execution.get("runs")
    if isinstance(runs, dict):
        return max(1, number(spec.get("runs")) or number(runs.get("max"), 1))
    return max(1, number(execution.get("runs_per_job"), 1))


def _pods(job: JobState) -> int:
    """How many pods a Job may have now."""
    mine = job.role == SHARD_ROLE and job.open and not (job.queue or job.suspended or job.elsewhere)
    return min(job.parallelism, job.left) if mine else 0

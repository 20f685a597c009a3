"""Which runs a pod executes, as the operator asks it in the arguments of the agent."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from robovast.base.ranges import Span
from robovast.model.packs import PlanSpec
from robovast.model.repetition import retry_groups

INDEX_ANNOTATION = "batch.kubernetes.io/job-completion-index"

AGENT = "agent"
"""The container that prepares a pod's runs and stores them; also its command."""

FETCH = "fetch"
"""The init container that prepared them in Jobs of earlier operators; also its command."""

RUN = "robovast"
"""The container of the runs."""

FIRST_PACK, ATTEMPT, REPEAT = "--first-pack", "--attempt", "--repeat"
ONLY = "--run"


@dataclass(frozen=True)
class PackRequest:
    """Which runs a pod is for."""

    first_pack: int
    """The pack of completion index 0."""
    index: int = 0
    """The pod's completion index."""
    attempt: int = 1
    repeat: str | None = None
    """Name of the list of bad runs that are repeated, in groups; whole packs when None."""
    run: int | None = None
    """The only run, by its id, of which nothing is stored; None: those of the pack or group."""

    @classmethod
    def of_pod(cls, pod: Mapping[str, Any]) -> PackRequest | None:
        """What a pod was asked; None when it is none of ours."""
        meta = pod["metadata"]
        annotations = meta.get("annotations") or {}
        spec = pod["spec"]
        containers = (*(spec.get("initContainers") or ()), *(spec.get("containers") or ()))
        words = next(
            (c.get("command") or () for c in containers if c["name"] in (FETCH, AGENT)), ()
        )
        asked = dict(pairwise(words))
        try:
            return cls(
                int(asked[FIRST_PACK]),
                int(annotations[INDEX_ANNOTATION]),
                int(asked.get(ATTEMPT, 1)),
                asked.get(REPEAT),
            )
        except (KeyError, TypeError, ValueError):
            return None

    @property
    def arguments(self) -> list[str]:
        """Arguments of the agent; the pod knows its index itself."""
        if self.run is not None:
            return [ONLY, str(self.run)]
        repeat = [REPEAT, self.repeat] if self.repeat else []
        return [FIRST_PACK, str(self.first_pack), ATTEMPT, str(self.attempt), *repeat]

    def chosen(
        self, plan: PlanSpec, bad_runs: Callable[[str], Sequence[Span]]
    ) -> tuple[int, Sequence[int]]:
        """Number of the pod's pack, and the ids of its runs.

        Args:
            plan: the campaign's.
            bad_runs: reads a list of bad runs.

        Raises:
            IndexError: the plan has no such runs.
        """
        if self.run is not None:
            return plan.pack_of(self.run), [self.run]
        number = self.first_pack + self.index
        if self.repeat is None:
            return number, plan.pack(number)
        ids = retry_groups(plan, bad_runs(self.repeat))[number]
        return plan.pack_of(ids[0]), ids

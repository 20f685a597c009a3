"""Campaigns that run the gauntlet: what becomes of each was decided before it began."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from random import Random
from typing import Any, TypeVar

from robovast_testbed.errors import StartFailed

from support.gauntlet.executions import ADDRESS, sending
from support.gauntlet.truth import Course
from support.kube.lab import Lab

T = TypeVar("T")


class Deed(StrEnum):
    """What is asked of a campaign after it was made."""

    SUSPEND = "suspended and resumed"
    RETRY = "bad runs retried"
    MORE = "more runs"
    DELETE_EARLY = "deleted while it runs"
    DELETE_LATE = "deleted at its end"


DESTINIES: Sequence[tuple[Deed, ...]] = (
    (),
    (Deed.SUSPEND,),
    (Deed.SUSPEND, Deed.RETRY),
    (Deed.RETRY,),
    (Deed.MORE,),
    (Deed.MORE, Deed.RETRY),
    (Deed.RETRY, Deed.MORE),
    (Deed.DELETE_EARLY,),
    (Deed.DELETE_LATE,),
    (Deed.SUSPEND, Deed.DELETE_LATE),
)


@dataclass
class Entrant:
    """A campaign, and what was asked of it."""

    lab: Lab
    name: str
    course: Course
    retention: str
    parallelism: int
    keep: int
    """For how long its Jobs stay once it has ended [s]."""
    destiny: Sequence[Deed]
    done: list[Deed] = field(default_factory=list)
    retries: list[float] = field(default_factory=list)
    """When its bad runs were asked for again [s since the epoch]."""
    late: dict[int, int] = field(default_factory=dict)
    """How often that had been asked when runs of a number were first asked for."""
    last: dict[str, Any] = field(default_factory=dict)
    """What the API server said of it last."""
    there: bool = False
    deleted: bool = False
    finished: bool = False
    """Its results were complete, as far as it was asked for."""

    @property
    def key(self) -> tuple[str, str]:
        return self.lab.namespace, self.name

    @property
    def attempts(self) -> int:
        return 1 + len(self.retries)

    def attempt_of(self, run: str) -> int:
        """In which attempt a bad run was executed last: those that came later are not repeated."""
        number = int(run.partition("/")[2])
        return self.attempts if len(self.retries) > self.late.get(number, 0) else 1

    @property
    def status(self) -> dict[str, Any]:
        found: dict[str, Any] = self.last.get("status", {})
        return found

    @property
    def seen(self) -> object:
        """How far it has come."""
        return self.there, self.done, self.status.get("runs"), self.status.get("conditions")

    @property
    def bucket(self) -> str | None:
        return self.status.get("bucket")

    def prepared(self) -> dict[str, Any]:
        """Its object."""
        folder = self.lab.folder / self.course.salt
        path = folder / "course.vast" if folder.exists() else self.course.write(folder)
        made = self.lab.prepared(path, self.name)
        spec = {
            "parallelism": self.parallelism,
            "storage": {"retention": self.retention},
            "ttlSecondsAfterFinished": self.keep,
        }
        return {**made, "spec": {**made["spec"], **spec}}

    def see(self, campaigns: Mapping[tuple[str, str], dict[str, Any]]) -> None:
        """Take note of what the API server says now."""
        self.there = self.key in campaigns
        self.last = campaigns.get(self.key, self.last)

    def play(self, over: Callable[[], bool]) -> Iterator[None]:
        """Do what is its destiny, step by step; nothing more begins once the time is over."""
        for deed in self.destiny:
            if deed in (Deed.SUSPEND, Deed.DELETE_EARLY):
                yield from self._until(lambda: self.status.get("runs", {}).get("stored", 0) > 0)
            else:
                yield from self._until(self._is_complete)
            if over():
                break
            yield from _DEEDS[deed](self)
            self.done.append(deed)
            if self.deleted:
                return
        yield from self._until(self._is_complete)
        self.finished = True

    def hurry(self) -> None:
        """Let it execute what is left all at once."""
        if self.there and not self.deleted and not self._is_complete():
            for _ in self._patch({"parallelism": 6}):
                time.sleep(1)

    def _until(self, condition: Callable[[], bool]) -> Iterator[None]:
        while not condition() and not self._is_complete():
            yield

    def _is_complete(self) -> bool:
        status, generation = self.status, self.last.get("metadata", {}).get("generation")
        available = any(
            item["type"] == "ResultsAvailable"
            and item["status"] == "True"
            and item.get("observedGeneration") == generation
            for item in status.get("conditions", [])
        )
        total = status.get("runs", {}).get("total")
        return (
            available
            and total == len(self.course.truth())
            and status.get("attempt", 1) == self.attempts
        )

    def _suspend(self) -> Iterator[None]:
        yield from self._patch({"suspend": True})
        end = time.monotonic() + 6
        while time.monotonic() < end:
            yield
        yield from self._patch({"suspend": False})

    def _retry(self) -> Iterator[None]:
        asked = time.time()
        yield from self._patch({"attempt": self.attempts + 1})
        self.retries.append(asked)

    def _more(self) -> Iterator[None]:
        course = self.course.with_runs(self.course.runs + 1)
        yield from self._patch({"runs": course.runs})
        self.late[self.course.runs] = len(self.retries)
        self.course = course

    def _delete(self) -> Iterator[None]:
        self.finished = self._is_complete()
        self.deleted = True
        words = ("delete", "campaign", self.name, "--wait=false", "--ignore-not-found")
        yield from persistently(lambda: self.lab.kubectl(*words))
        yield
        while self.there:
            yield

    def _patch(self, spec: dict[str, Any]) -> Iterator[None]:
        patch = json.dumps({"spec": spec})
        words = ("patch", "campaign", self.name, "--type=merge", f"--patch={patch}")
        yield from persistently(lambda: self.lab.kubectl(*words))
        # What was seen before the change says nothing of it.
        self.last = {**self.last, "status": {**self.status, "conditions": []}}


_DEEDS: Mapping[Deed, Callable[[Entrant], Iterator[None]]] = {
    Deed.SUSPEND: Entrant._suspend,
    Deed.RETRY: Entrant._retry,
    Deed.MORE: Entrant._more,
    Deed.DELETE_EARLY: Entrant._delete,
    Deed.DELETE_LATE: Entrant._delete,
}


def persistently(ask: Callable[[], object]) -> Iterator[None]:
    """Ask the API server until it answers."""
    while True:
        try:
            ask()
        except StartFailed:
            yield
        else:
            return


def shuffled(chance: Random, items: Sequence[T]) -> Iterator[T]:
    """All items in random order, again and again."""
    while True:
        yield from chance.sample(items, len(items))


def draw(
    chance: Random,
    places: Iterator[Sequence[Lab]],
    number: int,
    destinies: Iterator[tuple[Deed, ...]],
) -> list[Entrant]:
    """The next campaign, or two of one name in two namespaces that are made in one request."""
    return [
        Entrant(
            lab,
            f"g{number}",
            _course(chance, f"g{number}-{lab.namespace}", measured=number % 2 == 1),
            chance.choice(["Retain", "Retain", "Delete"]),
            chance.randint(1, 3),
            chance.choice([1, 60]),
            next(destinies),
        )
        for lab in next(places)
    ]


def _course(chance: Random, salt: str, measured: bool) -> Course:
    """A campaign, of packs as measured times suggest or of so many runs."""
    return Course(
        salt=salt,
        trace=sending(*ADDRESS),
        variants=chance.randint(2, 6),
        runs=chance.randint(1, 2),
        runs_per_job="auto" if measured else chance.randint(1, 6),
        pause=round(chance.uniform(0.1, 2), 1),
    )

"""Campaigns come and go while one fault is done after the other."""

from __future__ import annotations

import json
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from random import Random

from robovast_testbed.errors import StartFailed

from support.gauntlet.entrants import DESTINIES, Entrant, draw, persistently, shuffled
from support.gauntlet.faults import FAULTS, Arena, MissedError
from support.gauntlet.watch import Companion
from support.kube.lab import Lab

ROUND = 1.5
"""How often campaigns are looked at [s]."""
PATIENCE = 900.0
"""For how long nothing may get any further once nothing is done to the cluster any more [s]."""
MOST = 1800.0
"""For how long all campaigns may then take to end [s]."""


def say(text: str) -> None:
    print(f"{time.strftime('%H:%M:%S')} {text}", flush=True)


class Faults:
    """Does one fault after the other in a thread of its own."""

    def __init__(self, where: Arena, chance: Random, pause: float) -> None:
        self._arena, self._chance, self._pause = where, chance, pause
        self._over = threading.Event()
        self._thread = Companion(self._rage)
        self.done: Counter[str] = Counter()

    def __enter__(self) -> Faults:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.end()

    def _rage(self) -> None:
        for name in shuffled(self._chance, list(FAULTS)):
            if self._over.wait(self._chance.uniform(0.3, 1.7) * self._pause):
                return
            say(f"- {name}")
            try:
                FAULTS[name](self._arena, Random(self._chance.random()))  # noqa: S311
            except MissedError:
                say("  nobody was there to suffer it")
            except Exception as error:  # whatever it is: hours of others shall not be lost
                say(f"  it could not be done: {str(error).partition(chr(10))[0] or repr(error)}")
            else:
                self.done[name] += 1


@dataclass
class Gauntlet:
    """Campaigns that come and go."""

    arena: Arena
    labs: Sequence[Lab]
    chance: Random
    alive: int
    """How many campaigns are executed at once."""
    entrants: list[Entrant] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._destinies = shuffled(self.chance, DESTINIES)
        self._places = shuffled(self.chance, [*([lab] for lab in self.labs), self.labs])

    def run(self, minutes: float, pause: float) -> Counter[str]:
        """Let campaigns run until the time is over and all have ended; returns the faults."""
        playing: list[Iterator[None]] = []
        end = time.monotonic() + minutes * 60

        def is_over() -> bool:
            return time.monotonic() > end

        with Faults(self.arena, Random(self.chance.random()), pause) as faults:  # noqa: S311
            while not is_over():
                if len(playing) < self.alive:
                    playing += self._more(is_over)
                playing = self._round(playing)
        say("all is repaired")
        self._await_end(playing)
        return faults.done

    def _await_end(self, playing: list[Iterator[None]]) -> None:
        """Give up once nothing has got any further for long."""
        limit = time.monotonic() + MOST
        for entrant in self.entrants:
            entrant.hurry()
        give_up, before = 0.0, ""
        while playing:
            now, seen = time.monotonic(), repr([entrant.seen for entrant in self.entrants])
            if seen != before:
                give_up, before = min(now + PATIENCE, limit), seen
            if now > give_up:
                return
            playing = self._round(playing)

    def _more(self, is_over: Callable[[], bool]) -> list[Iterator[None]]:
        new = draw(self.chance, self._places, len(self.entrants), self._destinies)
        objects = {"apiVersion": "v1", "kind": "List", "items": [e.prepared() for e in new]}
        for entrant in new:
            self.arena.salts[entrant.key] = entrant.course.salt
            say(
                f"+ {entrant.name} in {entrant.lab.namespace}: {len(entrant.course.truth())} runs, "
                f"{entrant.retention}, {', '.join(entrant.destiny) or 'plain'}"
            )
        self.entrants += new
        words = ("apply", "--filename=-")
        for _ in persistently(
            lambda: self.arena.cluster.kubectl(*words, stdin=json.dumps(objects))
        ):
            time.sleep(ROUND)
        return [entrant.play(is_over) for entrant in new]

    def _round(self, playing: list[Iterator[None]]) -> list[Iterator[None]]:
        begin = time.monotonic()
        try:
            text = self.arena.cluster.kubectl(
                *("get", "campaigns", "--all-namespaces", "--output=json"),
                "--request-timeout=10s",
            )
        except StartFailed:
            text = ""
        if text:
            items = json.loads(text)["items"]
            self.arena.campaigns = {
                (item["metadata"]["namespace"], item["metadata"]["name"]): item
                for item in items
                if item["kind"] == "Campaign"
            }
            for entrant in self.entrants:
                entrant.see(self.arena.campaigns)
        left = [steps for steps in playing if next(steps, self) is not self]
        time.sleep(max(0.1, ROUND - (time.monotonic() - begin)))
        return left

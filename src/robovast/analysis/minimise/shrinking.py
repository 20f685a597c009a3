"""Makes parameters milder as long as a predicate holds. Pure functions of what it answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any, Protocol

Parameters = Mapping[str, Any]
StillFails = Callable[[Parameters], bool]
"""Whether parameters fail as those do that are minimised."""


class Reduction(Protocol):
    """A parameter that can be milder."""

    def coarsely(self, now: Parameters, fails: StillFails) -> Parameters:
        """Much milder parameters that fail, found in large steps; `now` fails."""

    def finely(self, now: Parameters, fails: StillFails) -> Parameters:
        """Parameters of which no single step leads to milder ones that fail; `now` fails."""


@dataclass(frozen=True)
class Items:
    """Fewer items of a list: delta debugging (`ddmin`; Zeller and Hildebrandt, 2002)."""

    parameter: str

    def coarsely(self, now: Parameters, fails: StillFails) -> Parameters:
        """No item, else parts of the list, else all but one of ever smaller parts."""
        name, parts = self.parameter, 2
        if fails({**now, name: []}):
            return {**now, name: []}
        while len(items := now[name]) > 1:
            cut = _parts(items, min(parts, len(items)))
            kept = (part for part in cut if fails({**now, name: part}))
            others = _rests(cut) if len(cut) > 2 else ()
            rests = (rest for rest in others if fails({**now, name: rest}))
            if (part := next(kept, None)) is not None:
                now, parts = {**now, name: part}, 2
            elif (rest := next(rests, None)) is not None:
                now, parts = {**now, name: rest}, max(2, len(cut) - 1)
            elif len(cut) == len(items):
                break
            else:
                parts = 2 * len(cut)
        return now

    def finely(self, now: Parameters, fails: StillFails) -> Parameters:
        """Leave out one item after the other."""
        name = self.parameter
        while True:
            rests = _rests([[item] for item in now[name]])
            rest = next((rest for rest in rests if fails({**now, name: rest})), None)
            if rest is None:
                return now
            now = {**now, name: rest}


@dataclass(frozen=True)
class Ladder:
    """Milder values of a parameter: bisection between those that fail and those that do not."""

    parameter: str
    values: tuple[Any, ...]
    """The mildest first; the last one is the failing run's."""

    def coarsely(self, now: Parameters, fails: StillFails) -> Parameters:
        """The mildest value, else the one at which bisection arrives."""
        top = self.values.index(now[self.parameter])
        return self._below(now, top, fails)

    def finely(self, now: Parameters, fails: StillFails) -> Parameters:
        """As before, if one step is possible at all."""
        top = self.values.index(now[self.parameter])
        if top == 0 or not fails(self._at(now, top - 1)):
            return now
        return self._below(now, top - 1, fails)

    def _below(self, now: Parameters, high: int, fails: StillFails) -> Parameters:
        if high == 0 or fails(self._at(now, 0)):
            return self._at(now, 0)
        low = 0
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if fails(self._at(now, middle)) else (middle, high)
        return self._at(now, high)

    def _at(self, now: Parameters, step: int) -> Parameters:
        return {**now, self.parameter: self.values[step]}


def shrink(
    parameters: Parameters, reductions: Sequence[Reduction], fails: StillFails
) -> Parameters:
    """The mildest parameters that are found to fail: no single step leads to milder ones.

    Args:
        parameters: those of a run that failed.
        reductions: what can be milder, and lists of which items can be left out.
        fails: tells whether others fail, too; it is asked again for the same ones.
    """
    now = parameters
    for reduction in reductions:
        now = reduction.coarsely(now, fails)
    while True:
        before = now
        for reduction in reductions:
            now = reduction.finely(now, fails)
        if now == before:
            return now


def _parts(items: Sequence[Any], number: int) -> list[list[Any]]:
    """Consecutive parts of a list, of about equal size."""
    ends = [len(items) * part // number for part in range(number + 1)]
    return [list(items[first:end]) for first, end in zip(ends, islice(ends, 1, None), strict=False)]


def _rests(parts: Sequence[Sequence[Any]]) -> Iterator[list[Any]]:
    """All items but those of one part, for each; one after the other, since lists may be long."""
    for left_out in range(len(parts)):
        yield [item for other, part in enumerate(parts) if other != left_out for item in part]

"""What a campaign varied, and which of it separates failures best."""

from __future__ import annotations

import time
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Any

from robovast.evaluation.effects import MOST_VALUES, Effect, as_text, effects, factor_columns
from robovast.evaluation.library import Library
from robovast.evaluation.summaries import VariantRuns

PAUSE = 20
"""Minimum time between analyses of a campaign in progress, as a multiple of an analysis."""


@dataclass(frozen=True)
class Explained:
    """The factors of a campaign."""

    factors: list[str]
    """Those that vary; of those that determine each other, the first."""
    same: Mapping[str, list[str]]
    """The others that it determines, and that determine it."""
    effects: list[Effect]
    """How they separate failures, the clearest first."""
    axes: list[str]
    """The two that separate failures best and do not follow from each other; fewer if there are no
    two. Without failures, or without others, the first that vary."""


def explain(variants: Sequence[VariantRuns]) -> Explained:
    """Analyse the factors of a campaign's configurations."""
    columns = {name: _places(own) for name, own in factor_columns(variants).items()}
    groups: dict[tuple[int, ...], list[str]] = {}
    for name, places in columns.items():
        if places and max(places) > 0:
            groups.setdefault(places, []).append(name)
    same = {first: others for first, *others in groups.values()}
    found = effects(variants)
    ranked = [effect.factor for effect in found if effect.factor in same]
    # The rest are texts that are unlike nearly everywhere, or all of them where nothing failed.
    rest = sorted(set(same).difference(ranked), key=list(same).index)
    ranked += sorted(rest, key=lambda name: max(columns[name]) >= MOST_VALUES)
    return Explained(
        factors=list(same),
        same={first: others for first, others in same.items() if others},
        effects=found,
        axes=_axes({name: columns[name] for name in ranked}),
    )


def _places(values: Sequence[Any]) -> tuple[int, ...]:
    """For each value the number of different ones before it: equal for equivalent factors."""
    known: dict[Hashable, int] = {}
    return tuple(known.setdefault(as_text(value), len(known)) for value in values)


def _axes(ranked: Mapping[str, tuple[int, ...]]) -> list[str]:
    names = list(ranked)
    for second in names[1:]:
        first = names[0]
        if not _follows(ranked[first], ranked[second]):
            return [first, second]
    return names[:1]


def _follows(one: tuple[int, ...], other: tuple[int, ...]) -> bool:
    """Whether either determines the other."""
    pairs = len(set(zip(one, other, strict=True)))
    return pairs in (max(one) + 1, max(other) + 1)


@dataclass(frozen=True)
class _Known:
    version: int
    found: Explained
    until: float
    """How long it is good enough while the campaign is executed [s, monotonic]."""


class Explanations:
    """Explains campaigns; an answer is kept until the campaign changes. Thread-safe."""

    def __init__(self, library: Library) -> None:
        self._library = library
        self._known: dict[str, _Known] = {}
        self._lock = Lock()

    def of(self, name: str) -> tuple[int, Explained]:
        """The version of a campaign, and its factors then.

        Raises:
            InputError: there is no such campaign, or it cannot be read.
        """
        index = self._library.campaign(name)
        with self._lock:  # a second request waits for the first instead of computing the same
            known = self._known.get(name)
            running = index.active is not None
            if known and (
                known.version == index.version or (running and time.monotonic() < known.until)
            ):
                return known.version, known.found
            begin, version = time.monotonic(), index.version
            found = explain(index.variants)
            now = time.monotonic()
            self._known[name] = _Known(version, found, now + PAUSE * (now - begin))
            return version, found

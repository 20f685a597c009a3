"""Scores the sets of a batch: what their runs say, or why they say nothing."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any

from robovast.base.plugins import raised
from robovast.base.time_limit import time_limit
from robovast.campaign.layout import Layout
from robovast.model.document.search.section import Search
from robovast.search.extractor import Extractor, ExtractResult, completed_run_dirs
from robovast.search.history import Scored
from robovast.search.plugins import trace

NO_VERDICT = "no run came to a verdict"
LONGEST = 3600.0
"""How long an extractor may take for a set [s], as a postprocessing command for a run."""


def samples(layout: Layout, config: str) -> int:
    """Number of a set's runs that came to a verdict."""
    folder = layout.variant(config)
    return len(completed_run_dirs(folder)) if os.path.isdir(folder) else 0


def score(
    search: Search,
    extractor: Extractor,
    layout: Layout,
    configs: Mapping[str, str],
    measures: Iterable[str],
    longest: float = LONGEST,
) -> tuple[Scored, ...]:
    """The scores of sets; errors of the extractor are the set's.

    Args:
        search: the document's search.
        extractor: its extractor.
        layout: the campaign.
        configs: the configuration of each set, by identifier.
        measures: the measures that the strategy needs.
        longest: how long the extractor may take for a set [s].
    """
    wanted = _Wanted([o.name for o in search.objectives], sorted(measures), longest)
    return tuple(
        _score(wanted, extractor, layout.variant(config), id_, samples(layout, config))
        for id_, config in configs.items()
    )


@dataclass(frozen=True)
class _Wanted:
    """What an extractor must give, and when."""

    objectives: list[str]
    measures: list[str]
    longest: float
    """How long it may take [s]."""


def _score(wanted: _Wanted, extractor: Extractor, folder: Path, id_: str, count: int) -> Scored:
    if not count:
        return Scored(id_, error=NO_VERDICT)
    try:
        with time_limit(wanted.longest):
            result = extractor.extract(folder)
        objectives, measures = _numbers(wanted, result)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # even `sys.exit` is the set's error
        return Scored(id_, n_samples=count, error=raised(error), trace=trace(error))
    return Scored(id_, objectives, measures, count)


def _numbers(wanted: _Wanted, result: Any) -> tuple[dict[str, float], dict[str, float]]:
    if not isinstance(result, ExtractResult):
        raise TypeError(f"`extract` must return an ExtractResult, not {result!r:.80}")
    _demand("objective", wanted.objectives, result.objectives)
    _demand("measure", wanted.measures, result.measures)
    return _finite(result.objectives.items()), _finite(result.measures.items())


def _demand(what: str, wanted: Iterable[str], given: Mapping[str, float]) -> None:
    for name in wanted:
        if name not in given:
            known = ", ".join(given) or "none"
            raise ValueError(f"the {what} `{name}` is missing; there are: {known}")


def _finite(items: Iterable[tuple[str, Any]]) -> dict[str, float]:
    found = {}
    for name, value in items:
        if not isinstance(value, Real) or not math.isfinite(value):
            raise ValueError(f"`{name}` must be a finite number, not {value!r:.40}")
        found[str(name)] = float(value)
    return found

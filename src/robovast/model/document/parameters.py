"""Checks of the names and values that a document gives to the scenario's parameters."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from robovast.base.errors import Problem
from robovast.model.document.parts import Parts
from robovast.model.document.problems import suggest
from robovast.model.document.section import PluginCall
from robovast.model.document.source import KeyPath
from robovast.model.scenario import Scenario
from robovast.model.scenario_values import declaration, is_plain, refusal
from robovast.model.variations import BUILT_IN_TYPES
from robovast.model.variations.base_variation import Given

_SIMPLE = frozenset(kind.__name__ for kind in BUILT_IN_TYPES)
"""Variation types that leave values as they are."""


def wrong_parameters_in(
    parts: Parts,
    base: KeyPath,
    pairs: Iterable[dict[str, Any]],
    variations: Iterable[PluginCall] | None = None,
) -> Iterator[Problem]:
    """Parameters that the scenario lacks, and values that it does not accept."""
    for position, pair in enumerate(pairs):
        for name, value in pair.items():
            path = (*base, position, name)
            yield from unknown_parameter(parts, path, name, at_key=True)
            yield from wrong_value(parts, path, Given((), name, value), variations)


def unknown_parameter(parts: Parts, path: KeyPath, name: str, *, at_key: bool) -> Iterator[Problem]:
    """The problem of a name that is no parameter of the scenario."""
    if isinstance(parts.scenario, Scenario) and parts.scenario.parameter(name) is None:
        known = [parameter.name for parameter in parts.scenario.parameters]
        yield parts.source.problem(
            path,
            f"the scenario `{parts.scenario.name}` has no parameter `{name}`",
            suggest(name, known) or "It declares no parameters.",
            at_key=at_key,
        )


def wrong_value(
    parts: Parts, path: KeyPath, given: Given, variations: Iterable[PluginCall] | None = None
) -> Iterator[Problem]:
    """The problem of a value that the scenario does not accept for its parameter.

    Variation types may read poses and lists in forms of their own and replace them; what they leave
    is checked when they have been applied.

    Args:
        parts: of the document.
        path: of the value, or of what makes it.
        given: the value; for another parameter than the scenario's it has no problem here.
        variations: those of its entry.
    """
    scenario = parts.scenario
    if not isinstance(scenario, Scenario):
        return
    others = any(call.name not in _SIMPLE for call in variations or ())
    if others and not is_plain(scenario, given.name):
        return
    why = refusal(scenario, given.name, given.value)
    if why is not None:
        declared = f"{declaration(scenario, given.name)}: give such values, or change that line."
        yield parts.source.problem(path, why, f"{given.remedy} {declared}".strip())

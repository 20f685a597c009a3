"""Checks of a `search` that its models cannot express."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

from pydantic import BaseModel, ValidationError

from robovast.base.errors import InputError, Problem
from robovast.base.plugins import plugin_errors, raised
from robovast.model.document.checks import check_variation
from robovast.model.document.parameters import unknown_parameter, wrong_parameters_in, wrong_value
from robovast.model.document.parts import Parts
from robovast.model.document.problems import problems_of, suggest
from robovast.model.document.search.plugins import EXTRACTORS, STRATEGIES, load_search_plugin
from robovast.model.document.search.section import Search
from robovast.model.document.search.space import Values, at, choices, values_at
from robovast.model.document.search.template import doubtful, markers, replaced, unclosed
from robovast.model.document.section import PluginCall
from robovast.model.document.source import KeyPath
from robovast.model.variations.base_variation import Given

_BASE: KeyPath = ("search",)
_TEMPLATE = ("variations", "parameters")


def check_search(parts: Parts, search: Search) -> list[Problem]:
    """All problems of a search, whose form is right."""
    return [
        *_check_runs(parts),
        *_check_markers(parts, search),
        *_check_repeated(parts, search),
        *_check_parameters(parts, search),
        *_check_template(parts, search),
        *_check_strategy(parts, search),
        *_check_extract(parts, search),
    ]


def search_warnings(parts: Parts, search: Search) -> Iterator[Problem]:
    """Warnings about what is allowed and usually a mistake."""
    for key in _TEMPLATE:
        for path, text in doubtful(parts.source.data["search"].get(key)):
            yield parts.source.problem(
                (*_BASE, key, *path),
                f"the marker in `{text}` is not replaced",
                "Only a value that is a marker as a whole is.",
            )
    if not search.budget:
        yield parts.source.problem(
            _BASE,
            "without a `budget`, the search may never end",
            "`budget: [{batches: 50}]` limits it.",
        )


def _check_runs(parts: Parts) -> Iterator[Problem]:
    if parts.execution is not None and parts.execution.test() is not None:
        yield parts.source.problem(
            ("execution", "runs"),
            "must be a number if a `search` chooses the configurations",
            "It compares sets of parameters by equally many runs, and ends by its own `budget`.",
        )


def _check_markers(parts: Parts, search: Search) -> Iterator[Problem]:
    for key in _TEMPLATE:
        for path, name in markers(parts.source.data["search"].get(key)):
            if name not in search.search_space:
                yield parts.source.problem(
                    (*_BASE, key, *path),
                    f"`${name}` names no dimension of the search space",
                    suggest(name, search.search_space),
                )
        for path, text in unclosed(parts.source.data["search"].get(key)):
            yield parts.source.problem(
                (*_BASE, key, *path),
                f"the marker `{text}` lacks its closing brace",
                f"Write `{text}}}`.",
            )


def _check_repeated(parts: Parts, search: Search) -> Iterator[Problem]:
    """A parameter that is given again would make the first one's dimension a dummy."""
    seen: set[str] = set()
    for index, pair in enumerate(search.parameters or []):
        for name in pair:
            if name in seen:
                yield parts.source.problem(
                    (*_BASE, "parameters", index, name),
                    f"the parameter `{name}` is given twice",
                    "Remove one of them; only the last would have an effect.",
                )
            seen.add(name)


def _check_parameters(parts: Parts, search: Search) -> Iterator[Problem]:
    """Parameters and dimensions without marker are parameters of the scenario."""
    for values in _samples(search):
        pairs = [
            replaced(p, values) if _is_known(p, values) else {} for p in search.parameters or []
        ]
        yield from wrong_parameters_in(parts, (*_BASE, "parameters"), pairs, search.variations)
    section = parts.source.data["search"]
    used = {name for key in _TEMPLATE for _, name in markers(section.get(key))}
    for name in search.search_space:
        if name not in used:
            path = (*_BASE, "search_space", name)
            yield from unknown_parameter(parts, path, name, at_key=True)
            yield from _check_dimension(parts, search, path, name)


def _check_dimension(parts: Parts, search: Search, path: KeyPath, name: str) -> Iterator[Problem]:
    """Values that the scenario does not accept for the parameter of a dimension's name."""
    dimension = search.search_space[name]
    remedy = f"`type: {dimension.type}` proposes such values."
    given = [Given(("type",), name, at(dimension, 0.5), remedy)]
    if dimension.type == "choice":
        values = enumerate(choices(dimension) or ())
        given = [Given(("values", index), name, value) for index, value in values]
    for one in given:
        yield from wrong_value(parts, (*path, *one.path), one, search.variations)


def _samples(search: Search) -> Iterator[Values]:
    """A set from the middle of the space, and others so that every choice occurs."""
    space = search.search_space
    middle = values_at(space, dict.fromkeys(space, 0.5))
    yield middle
    for name, dimension in space.items():
        yield from ({**middle, name: value} for value in choices(dimension) or ())


def _is_known(template: Any, values: Values) -> bool:
    """Whether all of its markers are complete, and name dimensions."""
    named = all(name in values for _, name in markers(template))
    return named and not any(unclosed(template))


def _check_template(parts: Parts, search: Search) -> Iterator[Problem]:
    """The variations, with sets from the space."""
    for position, call in enumerate(search.variations or []):
        for values in _samples(search):
            if _is_known(call.parameters, values):
                given = PluginCall(name=call.name, parameters=replaced(call.parameters, values))
                path = (*_BASE, "variations", position)
                yield from check_variation(parts, path, given, search.variations or [])


def _check_strategy(parts: Parts, search: Search) -> Iterator[Problem]:
    yield from _check_single_objective(parts, search)
    try:
        kind = load_search_plugin(search.strategy, STRATEGIES, parts.folder)
    except InputError as error:
        yield parts.source.problem((*_BASE, "strategy"), str(error))
        return
    if getattr(kind, "SINGLE_OBJECTIVE", False) and len(search.objectives) > 1:
        yield parts.source.problem(
            (*_BASE, "objectives"), f"`{search.strategy}` optimizes one objective, not several"
        )
    wrong = list(_check_strategy_parameters(parts, search, getattr(kind, "PARAMS_MODEL", None)))
    yield from wrong or _check_strategy_made(parts, search, kind)
    yield from _check_metrics(parts, search, getattr(kind, "METRICS", None))


def _check_single_objective(parts: Parts, search: Search) -> Iterator[Problem]:
    for position, item in enumerate(search.stopping):
        if len(search.objectives) > 1 and item.metric is None:
            yield parts.source.problem(
                (*_BASE, "stopping", position), "needs one objective; there are several"
            )


def _check_strategy_parameters(
    parts: Parts, search: Search, model: type[BaseModel] | None
) -> Iterator[Problem]:
    if model is None:
        return
    base = (*_BASE, "strategy_parameters")
    try:
        model.model_validate(search.strategy_parameters)
    except ValidationError as error:
        given = "strategy_parameters" in parts.source.data["search"]
        yield from problems_of(error, parts.source, model, base if given else _BASE)


def _check_strategy_made(parts: Parts, search: Search, kind: Any) -> Iterator[Problem]:
    """What the strategy itself says about the search."""
    model, given = getattr(kind, "PARAMS_MODEL", None), dict(search.strategy_parameters)
    try:
        with plugin_errors(lambda error: InputError(_reason(error))):
            made = kind(search, given if model is None else model.model_validate(given))
            needed = getattr(made, "needed_measures", ())
    except InputError as error:
        yield parts.source.problem((*_BASE, "strategy"), f"`{search.strategy}`: {error}")
        return
    known = _extracted(parts, search)
    for name in sorted(needed):
        if known is not None and name not in known:
            yield parts.source.problem(
                (*_BASE, "strategy_parameters"),
                f"`{search.strategy}` needs the measure `{name}`, which `extract` does not give",
                suggest(name, known),
            )


def _extracted(parts: Parts, search: Search) -> frozenset[str] | None:
    """Names of the extractor's numbers; None where they are not known."""
    plugin, params = search.extract.call
    with suppress(InputError), plugin_errors(lambda error: InputError(_reason(error))):
        return _names(load_search_plugin(plugin, EXTRACTORS, parts.folder), params)
    return None


def _reason(error: BaseException) -> str:
    """An error on purpose says what is wrong; of any other one, the place helps."""
    return str(error) if isinstance(error, ValueError) else raised(error)


def _check_metrics(parts: Parts, search: Search, known: frozenset[str] | None) -> Iterator[Problem]:
    """Names of numbers that the strategy never reports."""
    for position, item in enumerate(search.stopping):
        if item.metric is not None and known is not None and item.metric.name not in known:
            yield parts.source.problem(
                (*_BASE, "stopping", position, "metric", "name"),
                f"`{search.strategy}` reports no `{item.metric.name}`",
                suggest(item.metric.name, known),
            )


def _check_extract(parts: Parts, search: Search) -> Iterator[Problem]:
    """The extractor, and names that it never gives."""
    given = "extract" in parts.source.data["search"]
    base = (*_BASE, "extract") if given else _BASE
    plugin, params = search.extract.call
    try:
        kind = load_search_plugin(plugin, EXTRACTORS, parts.folder)
    except InputError as error:
        yield parts.source.problem(base, str(error))
        return
    try:
        with plugin_errors(lambda error: InputError(_reason(error))):
            kind(**params)
            known = _names(kind, params)
    except InputError as error:
        yield parts.source.problem(base, f"`{plugin}` cannot be created: {error}")
        return
    for position, objective in enumerate(search.objectives):
        if known is not None and objective.name not in known:
            path = (*_BASE, "objectives", position, "name")
            remedy = suggest(objective.name, known)
            yield parts.source.problem(path, f"`extract` gives no `{objective.name}`", remedy)


def _names(kind: Any, params: dict[str, Any]) -> frozenset[str] | None:
    names = getattr(kind, "names", None)
    found: frozenset[str] | None = names(params) if names else None
    return found

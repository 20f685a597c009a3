"""Finds the differences from the existing tool that affect a .vast file (docs/coming-from.md)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from robovast.base.errors import Problem
from robovast.common.execution import campaign_prefix
from robovast.model.document import Document
from robovast.model.document.model import PluginCall
from robovast.model.scenario import parameter_types

_OTHER_PLACES = "the same seed gives other places than there"
_NOTES = {
    "OneOfVariation": "counts on over all alternatives, configurations outside; there names repeat",
    "PathVariationRandom": _OTHER_PLACES,
    "ObstacleVariation": f"{_OTHER_PLACES}, and obstacles are counted on over all items",
    "ObstacleVariationWithDistanceTrigger": f"{_OTHER_PLACES}, and obstacles are counted on",
    "FloorplanVariation": "a plan that cannot be built is drawn again; there it is passed on",
    "FloorplanGeneration": "a plan that cannot be built is an error; there it is passed on",
}
"""Differences that affect any use of a variation type."""
_SEEDED = frozenset(_NOTES) - {"OneOfVariation", "FloorplanGeneration"} | {
    "ParameterVariationDistributionGaussian",
    "ParameterVariationDistributionUniform",
}


def differences(document: Document) -> list[Problem]:
    """Parts of a document that mean something else than in the existing tool, in file order."""
    return sorted([*_of_document(document), *_of_variations(document)], key=lambda p: p.place)


def _of_document(document: Document) -> Iterator[Problem]:
    source, vast = document.source, document.vast
    if not vast.configuration and vast.search is None:
        yield source.problem((), "one configuration, `config1`, runs; there nothing did")
    for index, pattern in enumerate(vast.execution.run_files):
        if pattern.endswith("**"):
            path = ("execution", "run_files", index)
            yield source.problem(path, f"`{pattern}` takes all that is below; there nothing")
    if campaign_prefix(vast.campaign_name) != campaign_prefix(vast.campaign_name, "._-"):
        message = (
            f"results go into `{campaign_prefix(vast.campaign_name)}-…`, and `run.sh` keeps `_`"
        )
        yield source.problem(("metadata", "name"), message)


def _of_variations(document: Document) -> Iterator[Problem]:
    types = parameter_types(document.scenario)
    for index, entry in enumerate(document.vast.configuration or ()):
        for position, call in enumerate(entry.variations or ()):
            path = ("configuration", index, "variations", position)
            for message in _of_variation(call, types):
                yield document.source.problem(path, f"{call.name}: {message}")


def _of_variation(call: PluginCall, types: dict[str, str]) -> Iterator[str]:
    given = call.parameters
    if call.name in _NOTES:
        yield _NOTES[call.name]
    if call.name in _SEEDED and "seed" not in given:
        yield "the seed follows from the configuration's name; there it is required"
    if call.name == "ParameterVariationList" and types.get(str(given.get("name"))) == "string":
        numbers = [v for v in given.get("values") or () if isinstance(v, str) and _is_number(v)]
        if numbers:
            yield f"{numbers[0]!r} stays text, as the scenario declares; there it is a number"
    if call.name == "PathVariationRasterized" and _several(given.get("num_goal_poses")):
        yield "every path of several goals is made; there one a start at most"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _several(value: Any) -> bool:
    counts = value if isinstance(value, list) else [value]
    return any(isinstance(count, int) and count > 1 for count in counts)

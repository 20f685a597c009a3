"""Find differences from the original RoboVAST in a .vast file (docs/how-to/migrate.md)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError, Place, Problem
from robovast.base.file_errors import read_text
from robovast.base.plugins import plugins_of, split_file_reference
from robovast.common.execution import campaign_prefix
from robovast.model.document import Document
from robovast.model.document.commands import GROUP
from robovast.model.document.declared import apply_types
from robovast.model.document.files import match_run_files
from robovast.model.document.ignored import contract_environment
from robovast.model.document.section import PluginCall
from robovast.model.document.source import KeyPath, Source
from robovast.model.scenario import parameter_types

_OTHER_PLACES = "the same seed gives other places than in RoboVAST 1.x"
_NOTES = {
    "OneOfVariation": (
        "numbers the configurations of all alternatives consecutively; in RoboVAST 1.x, names "
        "repeat"
    ),
    "PathVariationRandom": _OTHER_PLACES,
    "ObstacleVariation": f"{_OTHER_PLACES}, and the numbers of obstacles continue over all items",
    "ObstacleVariationWithDistanceTrigger": (
        f"{_OTHER_PLACES}, and the numbers of obstacles continue"
    ),
    "FloorplanVariation": "a plan that cannot be built is sampled again; RoboVAST 1.x uses it",
    "FloorplanGeneration": "a plan that cannot be built is an error; RoboVAST 1.x uses it",
}
"""Differences that affect any use of a variation type."""
_SEEDED = frozenset(_NOTES) - {"OneOfVariation", "FloorplanGeneration"} | {
    "ParameterVariationDistributionGaussian",
    "ParameterVariationDistributionUniform",
}
_PLANS = {"FloorplanVariation": "variation_files", "FloorplanGeneration": "floorplans"}
"""Variation types of floor plans, and where they name files."""
_PLAN_WORDS = {
    r"\bDefault values\s*:": "`Default values:` is valid; in RoboVAST 1.x, it is an error",
    r"\d\s*(cm|mm)\b": "lengths in cm and mm are valid; in RoboVAST 1.x, they are errors",
}


def differences(document: Document) -> list[Problem]:
    """Parts of a document that mean something else than in the existing tool, in file order."""
    found = (_of_document, _of_texts, _of_variations, _of_plans, _of_postprocessing)
    return sorted((p for kind in found for p in kind(document)), key=lambda p: p.place)


def _of_document(document: Document) -> Iterator[Problem]:
    source, vast = document.source, document.vast
    if not vast.configuration and vast.search is None:
        yield source.problem((), "one configuration, `config1`, runs; RoboVAST 1.x runs nothing")
    if source.is_followed:
        yield source.problem(
            (), ("a second YAML document causes a warning; RoboVAST 1.x does not warn")
        )
    for index, pattern in enumerate(vast.execution.run_files):
        path: KeyPath = ("execution", "run_files", index)
        if not match_run_files(document.folder, pattern):
            yield source.problem(path, f"`{pattern}` causes a warning; RoboVAST 1.x does not warn")
        elif pattern.endswith("**"):
            yield source.problem(
                path,
                (f"`{pattern}` includes all files below; in RoboVAST 1.x, it includes nothing"),
            )
    for path in contract_environment(source):
        message = (
            f"`{path[-1]}` keeps the value of the container interface; RoboVAST 1.x sets this value"
        )
        yield source.problem(path, message, at_key=True)
    if vast.execution.timeout is not None:
        yield source.problem(
            ("execution", "timeout"),
            ("also stops a run on this machine; RoboVAST 1.x stops it only on a cluster"),
        )
    if campaign_prefix(vast.campaign_name) != campaign_prefix(vast.campaign_name, "._-"):
        message = (
            f"results go into `{campaign_prefix(vast.campaign_name)}-…`, and `run.sh` keeps `_`"
        )
        yield source.problem(("metadata", "name"), message)


def _of_variations(document: Document) -> Iterator[Problem]:
    for index, entry in enumerate(document.vast.configuration or ()):
        for position, call in enumerate(entry.variations or ()):
            path = ("configuration", index, "variations", position)
            for message in (*_of_variation(call), *_of_navigation(call)):
                yield document.source.problem(path, f"{call.name}: {message}")


def _of_texts(document: Document) -> Iterator[Problem]:
    """Values that keep their text, because the scenario declares `string`."""
    types = parameter_types(document.scenario)
    read, typed = Source.read(document.source.file), Source.read(document.source.file)
    kept: dict[str, dict[KeyPath, str]] = {}
    for path, name in apply_types(typed):
        before, value = read.at(path), typed.at(path)
        listed = "ParameterVariationList" in path and types.get(name) == "string"
        same = isinstance(before, str) and not (listed and _is_number(before))
        if isinstance(value, str) and not same:
            kept.setdefault(name, {})[path] = value
    for name, values in kept.items():
        (path, first), more = next(iter(values.items())), len(values) - 1
        stay = "stays" if not more else f"and {more} more value{'s' * (more > 1)} stay"
        prefix = "" if name in path else f"{name}: "
        message = f"{prefix}{first!r} {stay} text; in RoboVAST 1.x, YAML decides"
        yield document.source.problem(path, message)


def _of_variation(call: PluginCall) -> Iterator[str]:
    given = call.parameters
    if call.name in _NOTES:
        yield _NOTES[call.name]
    if call.name in _SEEDED and "seed" not in given:
        yield "the seed is derived from the configuration's name; RoboVAST 1.x requires it"


def _of_navigation(call: PluginCall) -> Iterator[str]:
    given = call.parameters
    if call.name == "PathVariationRasterized" and _several(given.get("num_goal_poses")):
        yield "creates every path of several goals; RoboVAST 1.x creates at most one for each start"
    if call.name == "PathVariationRasterized" and isinstance(given.get("start_pose"), str):
        yield "`start_pose` gets the start; in RoboVAST 1.x, a name always fails"
    if call.name == "PathVariationRandom" and any(map(_is_written, _poses(given))):
        yield "explicit poses are used for the path; RoboVAST 1.x ignores them"
    if call.name in _PLANS and len(_listed(given.get("name"))) == 1:
        yield "`name` has one item, for the map alone; RoboVAST 1.x requires two"
    for key in ("name", "spawn_trigger_point", "spawn_trigger_threshold"):
        if any(str(value).startswith("@") for value in _listed(given.get(key))):
            yield f"the `@` of `{key}` is dropped; in RoboVAST 1.x, it becomes part of the name"


def _of_plans(document: Document) -> Iterator[Problem]:
    """What floor plans say that the language there does not know."""
    calls = (call for entry in document.vast.configuration or () for call in entry.variations or ())
    named = (call.parameters.get(_PLANS[call.name]) for call in calls if call.name in _PLANS)
    files = [document.folder / str(name) for names in named for name in _listed(names)]
    plans = (
        plan for file in files for plan in (file, *(file.parent / p for p in _imports(_text(file))))
    )
    for plan in dict.fromkeys(plans):
        for number, line in enumerate(_text(plan).splitlines(), start=1):
            for pattern, message in _PLAN_WORDS.items():
                if (found := re.search(pattern, line.partition("//")[0])) is not None:
                    yield Problem(Place(plan, number, found.start() + 1), "", message)


def _of_postprocessing(document: Document) -> Iterator[Problem]:
    for section in ("results_processing", "analysis"):
        for index, call in enumerate(getattr(document.vast, section).postprocessing):
            path: KeyPath = (section, "postprocessing", index)
            if split_file_reference(call.name) is None and call.name not in plugins_of(GROUP):
                message = (
                    "if it is not installed, only this command fails; in RoboVAST 1.x, all "
                    "commands fail"
                )
                yield document.source.problem(path, f"{call.name}: {message}")
            plugins = _listed(call.parameters.get("plugins"))
            types = [plugin for plugin in plugins if isinstance(plugin, dict)]
            for given in (call.parameters, *types):
                for message in _of_command(given):
                    yield document.source.problem(path, f"{call.name}: {message}")


def _of_command(given: dict[str, Any]) -> Iterator[str]:
    if "workers" in given:
        yield "`workers` has no effect; `-j` sets the number of runs that are processed in parallel"
    if "skip_levels" in given:
        yield "`skip_levels` excludes these levels; in RoboVAST 1.x, it has no effect"
    if isinstance(given.get("min_level"), int):
        yield "`min_level` counts as this number; in RoboVAST 1.x, it counts as DEBUG"


def _poses(given: dict[str, Any]) -> list[Any]:
    return [given.get("start_pose"), *_listed(given.get("goal_poses"))]


def _is_written(pose: Any) -> bool:
    return isinstance(pose, dict)


def _listed(value: Any) -> list[Any]:
    if value is None:
        return []
    return value if isinstance(value, list) else [value]


def _text(file: Path) -> str:
    """Of a floor plan; what cannot be read is said when it is expanded."""
    try:
        return read_text(file)
    except InputError:
        return ""


def _imports(text: str) -> list[str]:
    return re.findall(r'^\s*import\s+"([^"]+)"', text, re.MULTILINE)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _several(value: Any) -> bool:
    counts = value if isinstance(value, list) else [value]
    return any(isinstance(count, int) and count > 1 for count in counts)

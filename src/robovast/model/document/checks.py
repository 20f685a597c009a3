"""Checks that a schema cannot express: rules between keys, missing files, unknown parameters."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel, TypeAdapter, ValidationError

from robovast.base.errors import CannotRunError, InputError, Problem, RobovastError
from robovast.base.plugins import plugins_of, split_file_reference
from robovast.base.sequential import State
from robovast.model.designs import MOST_PAIRS, MOST_SOBOL, pairs_of
from robovast.model.document.commands import BUILT_IN, GROUP, PROCESS, TopicsToCsv
from robovast.model.document.files import host_path, match_run_files
from robovast.model.document.model import ConfigurationEntry, Design, Notebooks
from robovast.model.document.parameters import unknown_parameter, wrong_parameters_in, wrong_value
from robovast.model.document.parts import Parts
from robovast.model.document.problems import nearest, problems_of
from robovast.model.document.section import Plugin, PluginCall
from robovast.model.document.source import KeyPath
from robovast.model.scenario import Scenario
from robovast.model.variation_config import unknown_parameters
from robovast.model.variations import BUILT_IN_TYPES, Variation
from robovast.model.variations.loader import levels, load_variation

_PLUGIN: TypeAdapter[PluginCall] = TypeAdapter(Plugin)
_OF_RESULTS = (
    ("results_processing", "postprocessing", GROUP),
    ("analysis", "postprocessing", GROUP),
    ("search", "postprocessing", GROUP),
    ("results_processing", "publication", "robovast.publication_plugins"),
    ("results_processing", "metadata_processing", "robovast.metadata_processing"),
)
"""Plugin lists of results, each with the entry-point group of its plugins."""


def check_parts(parts: Parts) -> list[Problem]:
    """All problems that concern several keys, or the files around the document."""
    return [
        *_check_scenario(parts),
        *_check_names(parts),
        *_check_parameters(parts),
        *_check_variations(parts),
        *_check_designs(parts),
        *_check_commands(parts),
        *_check_processing(parts),
    ]


def warnings_of(parts: Parts) -> Iterator[Problem]:
    """Warnings about what is allowed but is usually a mistake."""
    patterns = parts.execution.run_files if parts.execution is not None else []
    for position, pattern in enumerate(patterns):
        if not match_run_files(parts.folder, pattern):
            yield parts.source.problem(
                ("execution", "run_files", position),
                f"`{pattern}` matches no file in {parts.folder}",
                "Patterns are relative to the .vast file and stay in its folder.",
            )
    yield from _impossible_decisions(parts)
    yield from _missing_notebooks(parts)
    for base, variation, parameters in _variations(parts):
        if variation.CONFIG_CLASS is not None:
            for key in unknown_parameters(parameters, variation.CONFIG_CLASS):
                message = f"`{base[-1]}` does not know the parameter `{key}`; it has no effect"
                yield parts.source.problem((*base, key), message, at_key=True)
    yield from _doubtful_processing(parts)


def _impossible_decisions(parts: Parts) -> Iterator[Problem]:
    test = parts.execution.test() if parts.execution is not None else None
    for outcome, state in ((False, State.SOUND), (True, State.BROKEN)) if test else ():
        if test is not None and test.most is not None and test.shortest(outcome) > test.most:
            yield parts.source.problem(
                ("execution", "runs"),
                f"no configuration can be classified as {state.word} after {test.most} runs",
                f"It takes at least {test.shortest(outcome)}: raise `max`, or `error`, or move "
                "`good` and `bad` apart.",
            )


def _missing_notebooks(parts: Parts) -> Iterator[Problem]:
    for section in ("evaluation", "analysis"):
        workloads = (parts.source.data.get(section) or {}).get("visualization") or []
        for position, item in enumerate(workloads):
            for name, notebooks in (item or {}).items():
                known = {s: n for s, n in (notebooks or {}).items() if s in Notebooks.model_fields}
                for scope, notebook in known.items():
                    if notebook is not None and not os.path.isfile(parts.folder / notebook):
                        yield parts.source.problem(
                            (section, "visualization", position, name, scope),
                            f"there is no notebook `{notebook}` in {parts.folder}",
                            "The web UI cannot run it; paths are relative to the .vast file.",
                        )


def _check_scenario(parts: Parts) -> Iterator[Problem]:
    if parts.scenario is None and parts.execution is not None:
        yield parts.source.problem(
            ("execution",),
            "the key `scenario_file` is missing",
            "OpenSCENARIO 2 file, relative to the .vast file.",
        )
    if isinstance(parts.scenario, InputError):
        near = sorted(path.name for path in parts.folder.glob("*.osc"))
        remedy = f"Files next to the .vast file: {', '.join(near)}." if near else ""
        yield parts.source.problem(parts.scenario_key, str(parts.scenario), remedy)
    named = {entry.scenario_file for entry in parts.entries.values() if entry.scenario_file}
    if parts.execution is not None and parts.execution.scenario_file is not None:
        named.add(parts.execution.scenario_file)
    if len(named) > 1:
        yield parts.source.problem(
            parts.scenario_key,
            f"a campaign runs one scenario, but several are named: {', '.join(sorted(named))}",
            "Put each scenario into a .vast file of its own.",
        )


def _check_names(parts: Parts) -> Iterator[Problem]:
    first: dict[str, int] = {}
    for index, entry in parts.entries.items():
        if entry.name in first:
            yield parts.source.problem(
                ("configuration", index, "name"),
                f"the name `{entry.name}` occurs twice; the first is "
                f"configuration[{first[entry.name]}]",
                "Results are kept by name: give each configuration its own.",
            )
        first.setdefault(entry.name, index)


def _check_parameters(parts: Parts) -> Iterator[Problem]:
    for index, entry in parts.entries.items():
        base: KeyPath = ("configuration", index, "parameters")
        yield from wrong_parameters_in(parts, base, entry.parameters or [], entry.variations)
    if parts.execution is not None:
        base = ("execution", "local", "parameter_overrides")
        yield from wrong_parameters_in(parts, base, parts.execution.local.parameter_overrides)


def _check_variations(parts: Parts) -> Iterator[Problem]:
    for index, entry in parts.entries.items():
        base: KeyPath = ("configuration", index, "variations")
        for position, call in enumerate(entry.variations or []):
            yield from check_variation(parts, (*base, position), call, entry.variations or [])


def _check_designs(parts: Parts) -> Iterator[Problem]:
    for index, entry in parts.entries.items():
        if entry.design is not None:
            path: KeyPath = ("configuration", index, "design")
            for message, remedy in _wrong_design(entry.design, entry, parts.folder):
                yield parts.source.problem(path, message, remedy)


def _wrong_design(
    design: Design, entry: ConfigurationEntry, folder: Path
) -> Iterator[tuple[str, str]]:
    """Why a design does not fit the variations, and what would."""
    calls = entry.variations or []
    sizes = [levels(call.name, call.parameters, folder) for call in calls]
    drawn = [call.name for call, size in zip(calls, sizes, strict=True) if size is None]
    known = [size for size in sizes if size is not None]
    if not calls:
        yield "a design chooses among variations, and there are none", "Give `variations`."
    elif drawn:
        yield (
            f"a design chooses among listed values, and `{drawn[0]}` draws its own",
            "Use `ParameterVariationList`, or remove `design`.",
        )
    elif design.count is not None and design.count > math.prod(known):
        yield (
            f"the design is larger than the product: {design.count:,} of {math.prod(known):,} "
            "combinations",
            "Give a smaller `count`, or remove `design`.",
        )
    elif design.kind == "sobol" and len(known) > MOST_SOBOL:
        yield f"a Sobol design has at most {MOST_SOBOL} variations, not {len(known)}", "Use `lhs`."
    elif design.kind == "pairwise" and pairs_of(known) > MOST_PAIRS:
        pairs = f"{pairs_of(known):,} pairs of values are more than {MOST_PAIRS:,}"
        yield pairs, "Give fewer values, or use `lhs`."


def check_variation(
    parts: Parts, path: KeyPath, call: PluginCall, variations: Sequence[PluginCall]
) -> Iterator[Problem]:
    """Problems of one of an entry's variations."""
    try:
        variation = load_variation(call.name, parts.folder)
    except RobovastError as error:
        problem = parts.source.problem(path, str(error))
        yield replace(problem, is_lacking=isinstance(error, CannotRunError))
        return
    base = _place_of_parameters(parts, path, call)
    wrong = list(_check_variation_parameters(parts, base, variation, call.parameters))
    yield from wrong or _check_given_values(parts, base, variation, call.parameters, variations)


def _place_of_parameters(parts: Parts, path: KeyPath, call: PluginCall) -> KeyPath:
    in_mapping = isinstance(_value_at(parts.source.data, path), dict)
    return (*path, call.name) if in_mapping else path


def _variations(parts: Parts) -> Iterator[tuple[KeyPath, type[Variation], dict[str, Any]]]:
    """Variation types that can be loaded, with the place of their parameters."""
    for index, entry in parts.entries.items():
        for position, call in enumerate(entry.variations or []):
            try:
                variation = load_variation(call.name, parts.folder)
            except RobovastError:
                continue  # reported where variations are checked
            path: KeyPath = ("configuration", index, "variations", position)
            yield _place_of_parameters(parts, path, call), variation, call.parameters


def _check_variation_parameters(
    parts: Parts, base: KeyPath, variation: type[Variation], parameters: dict[str, Any]
) -> Iterator[Problem]:
    model: type[BaseModel] | None = variation.CONFIG_CLASS
    if model is not None:
        yield from _misspelt(parts, base, model, parameters)
        wrong = _error(parts, base, model, parameters)
        yield from wrong
        if wrong:
            return
    # A plugin may use `name` for anything; for built-in types it is a scenario parameter.
    if variation not in BUILT_IN_TYPES:
        return
    named = parameters.get("name")
    for name in [named] if isinstance(named, str) else named or []:
        yield from unknown_parameter(parts, (*base, "name"), name, at_key=False)


def _check_given_values(
    parts: Parts,
    base: KeyPath,
    variation: type[Variation],
    parameters: dict[str, Any],
    variations: Sequence[PluginCall],
) -> Iterator[Problem]:
    types = parts.scenario.types if isinstance(parts.scenario, Scenario) else {}
    for given in variation.given_values(parameters, types):
        yield from wrong_value(parts, (*base, *given.path), given, variations)


def _misspelt(
    parts: Parts, base: KeyPath, model: type[BaseModel], parameters: dict[str, Any]
) -> Iterator[Problem]:
    for key, near in unknown_parameters(parameters, model).items():
        if near is not None:
            remedy = f"Did you mean `{near}`?"
            yield parts.source.problem((*base, key), f"unknown key `{key}`", remedy, at_key=True)


def _error(
    parts: Parts, base: KeyPath, model: type[BaseModel], parameters: dict[str, Any]
) -> list[Problem]:
    try:
        model.model_validate(parameters)
    except ValidationError as error:
        return problems_of(error, parts.source, model, base)
    return []


def _check_processing(parts: Parts) -> Iterator[Problem]:
    """Calls of built-in commands whose parameters are invalid."""
    for path, call, group in _processing(parts):
        model = BUILT_IN.get(call.name) if group == GROUP else None
        if model is not None:
            base = _place_of_parameters(parts, path, call)
            yield from _misspelt(parts, base, model, call.parameters)
            yield from _error(parts, base, model, call.parameters)


def _doubtful_processing(parts: Parts) -> Iterator[Problem]:
    """Warnings: calls without effect, and plugins that are not installed (needed only later)."""
    for path, call, group in _processing(parts):
        model = BUILT_IN.get(call.name) if group == GROUP else None
        file = split_file_reference(call.name)
        known = plugins_of(group)
        if model is not None:
            base = _place_of_parameters(parts, path, call)
            for key, message in _without_effect(call, model):
                yield parts.source.problem((*base, *key), message, at_key=bool(key))
        elif file is not None and not os.path.isfile(parts.folder / file[0]):
            yield parts.source.problem(path, f"there is no file {file[0]} in {parts.folder}")
        elif file is None and call.name not in known:
            near = nearest(call.name, known)
            message = f"no plugin `{call.name}` is installed here"
            yield parts.source.problem(path, message, f"Did you mean `{near}`?" if near else "")


def _without_effect(call: PluginCall, model: type[BaseModel]) -> Iterator[tuple[KeyPath, str]]:
    """Parameters of a built-in command that do nothing; () when the whole command does nothing."""
    for key in unknown_parameters(call.parameters, model):
        yield (key,), f"`{call.name}` does not know the parameter `{key}`; it has no effect"
    if call.name == PROCESS and "workers" in call.parameters:
        yield ("workers",), "`workers` has no effect: runs are always processed in parallel"
    if call.name == TopicsToCsv.command and not call.parameters.get("topics"):
        yield (), f"`{call.name}` without `topics` does nothing"


def _processing(parts: Parts) -> Iterator[tuple[KeyPath, PluginCall, str]]:
    """Path, plugin call and plugin group of every well-formed call in the plugin lists."""
    for section, key, group in _OF_RESULTS:
        inner = parts.source.data.get(section)
        listed = inner.get(key) if isinstance(inner, dict) else None
        for position, item in enumerate(listed if isinstance(listed, list) else ()):
            with suppress(ValidationError):  # reported where the document's form is checked
                yield (section, key, position), _PLUGIN.validate_python(item), group


def _value_at(data: Any, path: KeyPath) -> Any:
    for part in path:
        data = data[part]
    return data


def _check_commands(parts: Parts) -> Iterator[Problem]:
    if parts.execution is None:
        return
    for key in ("pre_command", "post_command"):
        command = getattr(parts.execution, key)
        if command is not None:
            yield from _check_command(parts, key, command)


def _check_command(parts: Parts, key: str, command: str) -> Iterator[Problem]:
    path = host_path(parts.folder, command)
    if path is None:
        return  # a file of the image, which is not available here
    if not os.path.isfile(path):
        yield parts.source.problem(
            ("execution", key),
            f"`{command}` is {path} on this machine, and there is no such file",
            "`/config` is the folder of the .vast file.",
        )
    elif key == "post_command" and not os.access(path, os.X_OK):
        yield parts.source.problem(
            ("execution", key), f"{path} is not executable", f"chmod +x {path.name}"
        )

"""Expands configuration entries to variants: applies variations in order and names the results."""

from __future__ import annotations

import logging
import os
import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from robovast.base.errors import CannotRunError, InputError, RobovastError
from robovast.base.plugins import raised
from robovast.base.serialization import to_plain
from robovast.model.designs import Row, rows_of
from robovast.model.document import Document
from robovast.model.document.model import NAME_PATTERN, ConfigurationEntry
from robovast.model.document.section import PluginCall, merge_pairs
from robovast.model.expansion.containers import ContainerRunner, Containers
from robovast.model.expansion.designed import Chooser, Configs, design_sizes
from robovast.model.expansion.limit import refuse_too_many, too_many, variant_limit
from robovast.model.scenario import Scenario, read_scenario
from robovast.model.scenario_values import declaration, refusal
from robovast.model.variant import ConfigFile, Variant, VariationRecord
from robovast.model.variations import Variation
from robovast.model.variations.factors import FACTORS, all_factors
from robovast.model.variations.loader import load_variation

_log = logging.getLogger(__name__)

Progress = Callable[[str], None]

DEFAULT_ENTRY = ConfigurationEntry.model_construct(name="config1")
"""Entry of a document without configurations: the scenario with its own defaults."""

_OWN_KEYS = frozenset({"name", "config", "_config_files", FACTORS})


@dataclass(frozen=True)
class Composition:
    """The result of expanding a document."""

    variants: tuple[Variant, ...]
    input_files: tuple[Path, ...] = ()
    """Files below the document's folder that the variation types read, relative to it."""
    transient_files: tuple[ConfigFile, ...] = ()
    """Files that variation types made for the campaign's `_transient` folder."""


def expand(document: Document, output_dir: Path, progress: Progress | None = None) -> list[Variant]:
    """The variants of a document; see `compose`."""
    return list(compose(document, output_dir, progress).variants)


def compose(
    document: Document,
    output_dir: Path,
    progress: Progress | None = None,
    containers: Containers = ContainerRunner,
) -> Composition:
    """All variants of a document, in document order, and their files.

    The result is the same on every machine if all variation types are deterministic; the built-in
    types are.

    Args:
        document: a checked document.
        output_dir: existing folder for files of variation types; `Variant.files` points into it, so
            keep it as long as they are needed.
        progress: receives the messages of variation types.
        containers: starts containers for variation types that need one.

    Raises:
        InputError: a variation type fails, or makes something that no run can use.
        CannotRunError: a variation type needs a container, and none can be started.
    """
    if document.vast.search is not None:
        raise InputError(
            f"{document.path}: a `search` proposes its configurations while it runs, so there is "
            "no list of them",
            hint="run `vast config list` to see its first batch",
        )
    limit = variant_limit()
    refuse_too_many(document, limit)
    scenario = read_scenario(document.scenario)
    used: list[Variation] = []
    variants: list[Variant] = []
    surroundings = _Surroundings(document, output_dir, progress or _ignore, containers)
    for entry in document.vast.configuration or [DEFAULT_ENTRY]:
        variants += _expand_entry(surroundings, scenario, entry, used, _designed(document, entry))
        if len(variants) > limit:
            detail = f"as far as `{entry.name}`"
            raise too_many(document.path, len(variants), limit, detail)
    _refuse_shared_names(document, variants)
    return Composition(tuple(variants), _input_files(document, used), _transient_files(used))


def expand_rows(
    document: Document, entry: ConfigurationEntry, rows: Sequence[Row]
) -> list[Variant]:
    """The variants of chosen combinations of an entry's variations, whose types make no files."""
    surroundings = _Surroundings(document, document.folder, _ignore, ContainerRunner)
    chooser = Chooser(entry, design_sizes(entry, document.folder), rows)
    scenario = read_scenario(document.scenario)
    return list(_expand_entry(surroundings, scenario, entry, [], chooser))


def _designed(document: Document, entry: ConfigurationEntry) -> Chooser | None:
    """What applies the design of an entry; None if it has none."""
    if entry.design is None:
        return None
    sizes = design_sizes(entry, document.folder)
    return Chooser(entry, sizes, rows_of(entry.design, sizes))


def _ignore(message: str) -> None:
    del message


@dataclass(frozen=True)
class _Surroundings:
    """What every variation type of a document receives."""

    document: Document
    output_dir: Path
    progress: Progress
    containers: Containers

    def runner(self, kind: type[Variation], parameters: Any) -> tuple[ContainerRunner] | tuple[()]:
        """The runner of the container that a variation type needs; empty if it needs none."""
        image = kind.get_required_container(parameters)
        if image is None:
            return ()
        if not isinstance(image, str):
            raise TypeError(f"get_required_container must name an image, not {image!r}")
        return (self.containers(image, self.progress),)


def _expand_entry(
    surroundings: _Surroundings,
    scenario: Scenario,
    entry: ConfigurationEntry,
    used: list[Variation],
    chooser: Chooser | None,
) -> Iterable[Variant]:
    parameters = merge_pairs(entry.parameters or [])
    configs: Configs = [{"name": entry.name, "config": parameters, "_config_files": []}]
    records: list[VariationRecord] = []
    for call in entry.variations or []:
        started, clock = datetime.now(UTC), time.perf_counter()
        vary = _applying(surroundings, entry, call, used)
        configs = chooser.vary(configs, vary) if chooser else vary(configs)
        duration = round(time.perf_counter() - clock, 6)
        records.append(VariationRecord(call.name, started.isoformat(), duration))
    _warn_of_unknown(entry, configs, scenario)
    variants = [_variant(entry, config, tuple(records)) for config in configs]
    for variant in variants:
        _refuse_wrong_values(surroundings.document, variant, scenario)
    return variants


def _applying(
    surroundings: _Surroundings, entry: ConfigurationEntry, call: PluginCall, used: list[Variation]
) -> Callable[[Configs], Configs]:
    """A call of a variation type as a function, which notes each variation that it used."""

    def vary(configs: Configs) -> Configs:
        variation, made = _apply(surroundings, entry, call, configs)
        used.append(variation)
        return made

    return vary


def _warn_of_unknown(
    entry: ConfigurationEntry, configs: list[dict[str, Any]], scenario: Scenario
) -> None:
    """Warn of parameters that a variation type sets and the scenario lacks: their runs will err."""
    known = {parameter.name for parameter in scenario.parameters}
    written = dict.fromkeys(key for config in configs for key in config.get("config") or {})
    for key in written:
        if key not in known and not key.startswith("_"):
            _log.warning(
                "configuration `%s`: a variation writes `%s`, but the scenario `%s` has no such "
                "parameter; it has %s.",
                *(entry.name, key, scenario.name, ", ".join(sorted(known)) or "none"),
            )


def _apply(
    surroundings: _Surroundings,
    entry: ConfigurationEntry,
    call: PluginCall,
    configs: Configs,
) -> tuple[Variation, Configs]:
    """The configurations that one variation type makes from the given ones."""
    document = surroundings.document
    where = f"configuration `{entry.name}`, variation `{call.name}`"
    try:
        kind = load_variation(call.name, document.folder)
        variation = kind(
            str(document.folder),
            call.parameters,
            dict(document.vast.general),
            surroundings.progress,
            str(document.scenario),
            str(surroundings.output_dir),
            *surroundings.runner(kind, call.parameters),
        )
        variation.entry = entry.name
        made = variation.variation(configs)
    except CannotRunError as error:
        raise CannotRunError(f"{where}: {error.message}", hint=error.hint) from error
    except (RobovastError, MemoryError):
        raise
    except (Exception, SystemExit) as error:
        raise InputError(f"{document.path}: {where} failed: {raised(error)}") from error
    if not isinstance(made, list) or not all(isinstance(item, dict) for item in made):
        raise InputError(
            f"{document.path}: {where} must return a list of configurations, "
            f"not {type(made).__name__}."
        )
    if not made:
        raise InputError(f"{document.path}: {where} created no configuration.")
    return variation, made


def _variant(
    entry: ConfigurationEntry,
    config: Mapping[str, Any],
    records: tuple[VariationRecord, ...],
) -> Variant:
    name = config.get("name")
    if not isinstance(name, str) or not re.match(NAME_PATTERN, name):
        raise InputError(
            f"configuration `{entry.name}`: {name!r} from a variation type is not a valid name of "
            "a results folder."
        )
    parameters = config.get("config") or {}
    files = tuple(_config_file(name, item) for item in config.get("_config_files") or ())
    extra = {key: value for key, value in config.items() if key not in _OWN_KEYS}
    try:
        values = to_plain(parameters)
        factors = all_factors(config.get(FACTORS) or {}, values)
        return Variant(name, entry.name, values, files, records, to_plain(extra), to_plain(factors))
    except TypeError as error:
        raise InputError(f"configuration `{name}`: {error}") from error


def _refuse_wrong_values(document: Document, variant: Variant, scenario: Scenario) -> None:
    """Refuse values of variations with which scenario-execution would not start."""
    for name, value in variant.parameters.items():
        why = refusal(scenario, name, value)
        if why is not None:
            raise InputError(
                f"{document.path}: configuration `{variant.name}`: {why}; "
                f"{declaration(scenario, name)}",
                hint="give such values, or change that line",
            )


def _input_files(document: Document, used: list[Variation]) -> tuple[Path, ...]:
    named = {str(name) for variation in used for name in variation.get_input_files()}
    paths = sorted(Path(os.path.realpath(document.folder / name)) for name in named)
    root = document.folder.resolve()
    return tuple(p.relative_to(root) for p in paths if p.is_relative_to(root) and os.path.isfile(p))


def _transient_files(used: list[Variation]) -> tuple[ConfigFile, ...]:
    pairs = [pair for variation in used for pair in variation.get_campaign_transient_files()]
    return tuple(dict.fromkeys(_config_file("transient files", pair) for pair in pairs))


def _config_file(variant: str, item: Any) -> ConfigFile:
    relative, source = item
    path = Path(str(relative))
    if path.is_absolute() or ".." in path.parts:
        raise InputError(f"configuration `{variant}`: the file `{relative}` leaves its folder.")
    if not os.path.isfile(source):
        raise InputError(
            f"configuration `{variant}`: the file {source} does not exist.",
            hint="add the file, or correct the path",
        )
    return ConfigFile(str(path), Path(source).absolute())


def _refuse_shared_names(document: Document, variants: list[Variant]) -> None:
    owner: dict[str, str] = {}
    for variant in variants:
        if variant.name in owner:
            raise InputError(
                f"{document.path}: two configurations are called `{variant.name}` (from the "
                f"entries `{owner[variant.name]}` and `{variant.entry}`)",
                hint="rename one of the entries",
            )
        owner[variant.name] = variant.entry

"""Finds strategies and extractors by name; the built-in ones need no entry point."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError
from robovast.base.optional_deps import OPTUNA, SEARCH, Extra
from robovast.base.plugins import load_plugin, plugins_of, split_file_reference
from robovast.model.document.problems import as_hint, suggest

STRATEGIES = "robovast.search_strategies"
EXTRACTORS = "robovast.extractors"

BUILT_IN: dict[str, dict[str, tuple[str, Extra | None]]] = {
    STRATEGIES: {
        "boundary": ("robovast.search.strategies.boundary:BoundaryStrategy", SEARCH),
        "optuna": ("robovast.search.strategies.optuna_samplers:OptunaStrategy", OPTUNA),
        "qd": ("robovast.search.strategies.quality_diversity:QualityDiversityStrategy", SEARCH),
        "random": ("robovast.search.strategies.random_sampling:RandomStrategy", None),
    },
    EXTRACTORS: {
        "failure_rate": ("robovast.search.extractors.failure_rate:FailureRate", None),
        "metrics": ("robovast.search.extractors.columns:ColumnExtractor", None),
    },
}
"""Where the built-in ones are, and the extra that they need."""


def load_search_plugin(reference: str, group: str, folder: Path) -> Any:
    """The class of a strategy or an extractor.

    Raises:
        InputError: it is missing or cannot be loaded.
        CannotRunError: it needs an extra that is not installed.
    """
    built_in, installed = BUILT_IN[group], plugins_of(group)
    if reference in built_in and reference not in installed:
        value, extra = built_in[reference]
        if extra is not None:
            extra.require(f"The strategy `{reference}`")
        return EntryPoint(reference, value, group).load()
    if split_file_reference(reference) is None and reference not in installed:
        use = as_hint(suggest(reference, [*built_in, *installed]))
        raise InputError(
            f"there is no plugin `{reference}` in {group}",
            hint=f"{use} A plugin in a file is written `<path>.py:<name>`",
        )
    return load_plugin(reference, group, folder)

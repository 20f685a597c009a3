"""Proposals: what a strategy answers becomes configurations, after it was checked."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError, RobovastError
from robovast.base.plugins import plugin_errors, raised
from robovast.model.document import Document
from robovast.model.document.search.space import holds, set_id
from robovast.model.expansion import Composition, compose
from robovast.model.expansion.sets import with_sets
from robovast.search.ending import until_batches
from robovast.search.plugins import make_strategy, search_of
from robovast.search.strategy import SearchStrategy
from robovast.search.types import ParamSet

Expand = Callable[[Document], Composition]


def ask(document: Document, strategy: SearchStrategy) -> list[ParamSet]:
    """The next sets of a strategy.

    Raises:
        InputError: the strategy raises, or proposes what is not in the space.
    """
    search = search_of(document)
    with plugin_errors(lambda error: _error(document, f"`ask` raised {raised(error)}")):
        proposed = strategy.ask(search.per_batch)
    with plugin_errors(lambda error: _unreadable(document, error)):
        return _sets(document, proposed)


def _sets(document: Document, proposed: Any) -> list[ParamSet]:
    most = search_of(document).per_batch
    if not isinstance(proposed, list | tuple) or not all(
        isinstance(item, ParamSet) for item in proposed
    ):
        raise _error(document, f"`ask` must return a list of ParamSet, not {proposed!r:.80}")
    if len(proposed) > most:
        raise _error(document, f"proposed {len(proposed)} sets where {most} are asked")
    return [_checked(document, item) for item in proposed]


def _checked(document: Document, item: ParamSet) -> ParamSet:
    """The set with plain values and an identifier of its own values."""
    space = search_of(document).search_space
    if not isinstance(item.values, dict):
        raise _error(document, f"proposed {item.values!r:.80} where a mapping of values is asked")
    if set(item.values) != set(space):
        odd = sorted(map(str, set(item.values) ^ set(space)))
        raise _error(document, f"proposed a set in which {', '.join(odd)} is missing or unknown")
    values = {name: _plain(value) for name, value in item.values.items()}
    for name, value in values.items():
        if not holds(space[name], value):
            raise _error(document, f"proposed {name} = {value!r}, which is not in the space")
        if space[name].type == "int":
            values[name] = int(value)
        elif space[name].type == "float":  # 1 is 1.0, and -0.0 is 0.0: equal sets are run once
            values[name] = float(value) + 0.0
    if item.n_reps is not None and (not isinstance(item.n_reps, int) or item.n_reps < 1):
        raise _error(document, f"wants {item.n_reps!r} repetitions; it must be at least 1")
    return ParamSet({name: values[name] for name in space}, set_id(values), item.n_reps)


def _plain(value: Any) -> Any:
    """A value of NumPy as Python's."""
    return value.item() if hasattr(value, "item") and not hasattr(value, "__len__") else value


def _unreadable(document: Document, error: BaseException) -> RobovastError:
    """The error about a proposal: what is wrong with it, or what it raises when it is read."""
    if isinstance(error, RobovastError):
        return error
    return _error(document, f"the proposal cannot be read: {raised(error)}")


def _error(document: Document, message: str) -> InputError:
    return InputError(f"{document.path}: the strategy `{search_of(document).strategy}` {message}.")


def with_runs(document: Document, runs: int) -> Document:
    """The document with another number of runs of each set."""
    execution = document.vast.execution.model_copy(update={"runs": runs})
    vast = document.vast.model_copy(update={"execution": execution})
    return dataclasses.replace(document, vast=vast)


def with_batches(document: Document, batches: int | None) -> Document:
    """The document whose search ends after so many batches instead; None changes nothing."""
    search = until_batches(search_of(document), batches)
    vast = document.vast.model_copy(update={"search": search})
    return dataclasses.replace(document, vast=vast)


def with_entries(document: Document, sets: Iterable[ParamSet]) -> Document:
    """The document with the configurations of parameter sets in place of its search."""
    return with_sets(document, search_of(document), (params.values for params in sets))


def expand_sets(
    document: Document, sets: Sequence[ParamSet], expand: Expand
) -> tuple[Composition, dict[str, str]]:
    """The configurations of parameter sets, and the name of each by the set's identifier.

    Raises:
        InputError: a set does not make exactly one configuration.
    """
    unique = {params.id: params for params in sets}
    composition = expand(with_entries(document, unique.values()))
    names: dict[str, list[str]] = {f"c{id_}": [] for id_ in unique}
    for variant in composition.variants:
        names[variant.entry].append(variant.name)
    for id_, params in unique.items():
        made = names[f"c{id_}"]
        if len(made) != 1:
            raise InputError(
                f"{document.path}: the `variations` of the search create {len(made)} "
                f"configurations of the parameter set {params.values}, but must create exactly one",
                hint="set every key that creates several configurations to a single value, such "
                "as `num_paths: 1`",
            )
    return composition, {id_: names[f"c{id_}"][0] for id_ in unique}


def first_batch(document: Document, output_dir: Path, tell: Callable[[str], None]) -> Composition:
    """The configurations of the first batch.

    Raises:
        InputError: they cannot be proposed, or not be made.
    """
    sets = ask(document, make_strategy(document))
    return expand_sets(document, sets, lambda derived: compose(derived, output_dir, tell))[0]

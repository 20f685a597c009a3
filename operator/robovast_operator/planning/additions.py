"""Configurations that were applied by hand: runs that are added to a campaign. Pure."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from pydantic import ValidationError

from robovast.base.errors import InputError
from robovast.base.serialization import dump_yaml
from robovast_operator.planning.accept import Files, accept
from robovast_operator.planning.campaign import Accepted, Object, Rejected
from robovast_operator.planning.configurations import added_entries, entry_name, reference
from robovast_operator.planning.revisions import Addition
from robovast_operator.settings import Settings

Call = Callable[..., int | str]
"""Calls a function with the arguments that follow."""


def _here(function: Callable[..., int | str], *arguments: object) -> int | str:
    return function(*arguments)


@dataclass(frozen=True)
class Additions:
    """What Configurations add."""

    found: tuple[Addition, ...] = ()
    accepted: Accepted | None = None
    """The campaign with their entries in its document."""
    problems: Mapping[str, str] = field(default_factory=dict)
    """By Configuration, why it adds nothing."""


def with_additions(
    obj: Object,
    accepted: Accepted,
    added: Sequence[Object],
    files: Files | Rejected | None,
    settings: Settings,
    known: dict[str, int | str],
    call: Call = _here,
) -> Additions:
    """What Configurations add to a campaign; one that is wrong does not harm the others.

    Args:
        obj: the Campaign.
        accepted: the same, accepted.
        added: the Configurations, oldest first.
        files: the campaign's input files, or why they cannot be read.
        settings: of the installation.
        known: variants by content of an entry, from the last time, or what is wrong with it.
        call: what calls the function that expands an entry.
    """
    if not accepted.pure:
        told = "runs can only be added to a campaign whose variations are all built in"
        return Additions(problems={item["metadata"]["name"]: told for item in added})
    taken = {str(entry["name"]) for entry in _written(obj)}
    found: list[Addition] = []
    good: list[Object] = []
    problems: dict[str, str] = {}
    expanded = _expand_new(obj, added, files, settings, known, call)
    for item, variants in zip(added, expanded, strict=True):
        name = entry_name(item)
        if name in taken:
            variants = f"the campaign has an entry `{name}` already; results are kept by name"
        if isinstance(variants, str):
            problems[item["metadata"]["name"]] = variants
            continue
        taken.add(name)
        good.append(item)
        runs = item["spec"].get("runs") or accepted.runs
        found.append(Addition(name, variants, runs, reference(item)))
    vast = _document(obj, [*_written(obj), *added_entries(good)])
    select = accepted.spec.select and [*accepted.spec.select, *(one.name for one in found)]
    spec = accepted.spec.model_copy(update={"vast": vast, "select": select})
    whole = replace(accepted, spec=spec, document_text=dump_yaml(vast))
    return Additions(tuple(found), whole, problems)


def _expand_new(
    obj: Object,
    added: Sequence[Object],
    files: Files | Rejected | None,
    settings: Settings,
    known: dict[str, int | str],
    call: Call,
) -> list[int | str]:
    """Variants of each Configuration, or what is wrong; what is known is not expanded again."""
    generation = obj["metadata"]["generation"]
    marks = [json.dumps([generation, entry_name(item), item["spec"]]) for item in added]
    for mark in known.keys() - set(marks):
        del known[mark]
    if isinstance(files, Rejected):
        return [known.get(mark, files.message) for mark in marks]
    for mark, item in zip(marks, added, strict=True):
        if mark not in known:
            try:
                known[mark] = call(_variants, obj, item, files, settings)
            except InputError as error:
                known[mark] = str(error)
    return [known[mark] for mark in marks]


def _variants(obj: Object, item: Object, files: Files | None, settings: Settings) -> int | str:
    """How many variants an entry has, expanded as the only one of the document; or what is wrong.

    So each is expanded once, however many others come and go.
    """
    try:
        (entry,) = added_entries([item])
    except ValidationError as error:
        return str(error)
    scenario = {k: v for e in _written(obj) for k, v in e.items() if k == "scenario_file"}
    spec = {**obj["spec"], "select": [], "vast": _document(obj, [scenario | entry])}
    alone = accept({**obj, "spec": spec}, files, settings)
    if isinstance(alone, Rejected):
        return alone.message
    return sum(found.variants for found in alone.entries)


def _written(obj: Object) -> list[Object]:
    """The entries of a campaign's own document."""
    return obj["spec"]["vast"].get("configuration") or [{"name": "config1"}]


def _document(obj: Object, entries: list[Object]) -> Object:
    """A campaign's document with these entries."""
    return {**obj["spec"]["vast"], "configuration": entries}

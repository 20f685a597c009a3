"""Configurations applied by hand, which add runs to a campaign. Pure functions."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pydantic import ValidationError

from robovast.kubeapi.source_files import Files
from robovast.model.packs import RUNS_LIMIT, Entry
from robovast_operator.kube.objects import Object
from robovast_operator.planning.accept import FIX_DOCUMENT, accept
from robovast_operator.planning.campaign import Accepted, Rejected
from robovast_operator.planning.configurations import (
    FIX_CONFIGURATION,
    added_entries,
    entry_name,
    invalid_configuration,
    reference,
)
from robovast_operator.planning.revisions import Addition, Planned
from robovast_operator.settings import OperatorSettings


@dataclass(frozen=True)
class Additions:
    """What the Configurations applied by hand add to a campaign."""

    found: tuple[Addition, ...] = ()
    problems: Mapping[str, str] = field(default_factory=dict)
    """By Configuration that adds nothing: the cause."""
    unknown: Mapping[str, Object] = field(default_factory=dict)
    """By content: the Configurations that must be expanded first."""

    def without_unknown(self, problem: str) -> Additions:
        """Return the same, if the unknown Configurations cannot be expanded."""
        problems = {item["metadata"]["name"]: problem for item in self.unknown.values()}
        return Additions(self.found, {**self.problems, **problems})


def with_additions(
    obj: Object,
    accepted: Accepted,
    added: Sequence[Object],
    expanded: dict[str, Entry | str],
    planned: Planned,
) -> Additions:
    """Compute the additions of Configurations; an invalid one does not affect the others.

    Args:
        obj: the Campaign.
        accepted: the same, accepted.
        added: the Configurations, oldest first.
        expanded: expansion or error of entries, by content; other entries are removed.
        planned: what was planned before, which stays as it is even if Configurations change.
    """
    if not accepted.pure:
        problem = "Runs can be added only to a campaign whose variations are all built in."
        if accepted.is_search:
            problem = "Runs cannot be added to a search."
        remedy = "Delete the Configuration, or create another Campaign."
        return Additions(
            problems={item["metadata"]["name"]: f"{problem} {remedy}" for item in added}
        )
    taken = {str(entry["name"]) for entry in _written(obj)}
    found: list[Addition] = []
    problems: dict[str, str] = {}
    total = planned.total
    unknown: dict[str, Object] = {}
    generation = obj["metadata"]["generation"]
    marks = [json.dumps([generation, entry_name(item), item["spec"]]) for item in added]
    for mark in expanded.keys() - set(marks):
        del expanded[mark]
    for item, mark in zip(added, marks, strict=True):
        entry, name = planned.of(item) or expanded.get(mark), entry_name(item)
        if name in taken:
            entry = f"The campaign already has a configuration `{name}`. Set another spec.name."
        if entry is None:
            unknown[mark] = item
            continue
        runs = item["spec"].get("runs") or accepted.runs
        if isinstance(entry, Entry):
            more = entry.variants * max(0, runs - planned.runs.get(name, 0))
            if total + more > RUNS_LIMIT:
                entry = (
                    f"The campaign would have {total + more:,} runs, but at most {RUNS_LIMIT:,} "
                    "are allowed. Lower spec.runs."
                )
            else:
                total += more
        if isinstance(entry, str):
            problems[item["metadata"]["name"]] = entry
            continue
        taken.add(name)
        (content,) = added_entries([item])
        found.append(Addition(entry, runs, reference(item), content))
    return Additions(tuple(found), problems, unknown)


def expand_alone(
    obj: Object, item: Object, files: Files | None, settings: OperatorSettings
) -> Entry | str:
    """Expand a Configuration as the only entry of the document; return an error as text.

    So each is expanded once, even if others come and go.

    Args:
        obj: the Campaign.
        item: the Configuration.
        files: the campaign's input files.
        settings: of the installation.
    """
    try:
        (entry,) = added_entries([item])
    except ValidationError as error:
        return invalid_configuration(error)
    scenario = {k: v for e in _written(obj) for k, v in e.items() if k == "scenario_file"}
    vast = {**obj["spec"]["vast"], "configuration": [scenario | entry]}
    alone = accept({**obj, "spec": {**obj["spec"], "select": [], "vast": vast}}, files, settings)
    if isinstance(alone, Rejected):
        return alone.message.replace(FIX_DOCUMENT, FIX_CONFIGURATION)
    return alone.entries[0] if alone.entries else NOTHING


NOTHING = "The Configuration expands to no parameter values. Check spec.variations."


def _written(obj: Object) -> list[Object]:
    """Return the entries of the campaign's own document."""
    return obj["spec"]["vast"].get("configuration") or [{"name": "config1"}]

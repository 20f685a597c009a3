"""Configurations that were applied by hand: runs that are added to a campaign. Pure."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pydantic import ValidationError

from robovast_operator.accept import Files, accept
from robovast_operator.campaign import Accepted, Object, Rejected
from robovast_operator.configurations import added_entries, entry_name, reference
from robovast_operator.revisions import Addition
from robovast_operator.settings import Settings


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
    files: Files | None,
    settings: Settings,
) -> Additions:
    """What Configurations add to a campaign; one that is wrong does not harm the others."""
    if not accepted.pure:
        told = "runs can only be added to a campaign whose variations are all built in"
        return Additions(problems={item["metadata"]["name"]: told for item in added})
    good: list[Object] = []
    whole = accepted
    problems: dict[str, str] = {}
    for item in added:
        tried = _accept_with(obj, [*good, item], files, settings)
        if isinstance(tried, Rejected):
            problems[item["metadata"]["name"]] = tried.message
        else:
            good.append(item)
            whole = tried
    counts = {entry.name: entry.variants for entry in whole.entries}
    found = tuple(
        Addition(
            name=entry_name(item),
            variants=counts[entry_name(item)],
            runs=item["spec"].get("runs") or accepted.runs,
            owner=reference(item),
        )
        for item in good
    )
    return Additions(found, whole, problems)


def _accept_with(
    obj: Object, added: Sequence[Object], files: Files | None, settings: Settings
) -> Accepted | Rejected:
    """The campaign with further entries in its document."""
    try:
        entries = added_entries(added)
    except ValidationError as error:
        return Rejected("InvalidSpec", str(error))
    changed = copy.deepcopy(obj)
    vast = changed["spec"]["vast"]
    vast["configuration"] = [*(vast.get("configuration") or [{"name": "config1"}]), *entries]
    if changed["spec"].get("select"):
        changed["spec"]["select"] += [entry["name"] for entry in entries]
    return accept(changed, files, settings)

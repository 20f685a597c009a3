"""Revisions of a campaign's plan: the first one, and those that append to it. Pure functions."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import takewhile

from pydantic import BaseModel, ConfigDict, ValidationError

from robovast.base.errors import InputError
from robovast.base.serialization import dump_yaml
from robovast.base.yaml_files import parse_yaml
from robovast.kubeapi.pod_contract.mounts import DOCUMENT_FILE, PLAN_FILE
from robovast.model.expansion.expand import DEFAULT_ENTRY
from robovast.model.packs import RUNS_LIMIT, Block, CampaignPlan, Entry, PlanSpec, first_blocks
from robovast_operator.kube.objects import Object
from robovast_operator.kube.sentences import clause
from robovast_operator.kube.untrusted_fields import mapping, text
from robovast_operator.planning.accept import same_document
from robovast_operator.planning.campaign import Accepted, Revision
from robovast_operator.planning.configurations import (
    added_entries,
    entry_name,
    invalid_configuration,
)

OWNERS_ANNOTATION = "robovast.io/owners"
"""Annotation with references to the Configurations of blocks, by number of the block, as JSON."""


NO_PLAN = PlanSpec(blocks=())
"""Revision of the compose Job, before the expansion."""


@dataclass(frozen=True)
class Addition:
    """A Configuration applied by hand, and its expansion."""

    expanded: Entry
    """Its expansion."""
    runs: int
    owner: Object
    """Reference to the object."""
    content: Object
    """The entry as it would stand in a document."""

    @property
    def name(self) -> str:
        """Return of the entry."""
        return self.expanded.name


TAKEN = (
    "The campaign has runs of a deleted Configuration with the same name. Set another `spec.name`."
)
CHANGED = (
    "The Configuration has changed after the runs were planned. Only `runs` may be raised. Undo "
    "the change, or apply the change as another Configuration. The planned runs continue."
)


@dataclass(frozen=True)
class Planned:
    """The entries of the newest plan, which do not change."""

    contents: Mapping[str, Object] = field(default_factory=dict)
    """The entries as they stand in its document, by name."""
    expanded: Mapping[str, Entry] = field(default_factory=dict)
    runs: Mapping[str, int] = field(default_factory=dict)
    """Of each variant, by entry."""
    owners: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """Uids of the Configurations that asked for them, by entry."""
    total: int = 0
    """All runs."""

    @classmethod
    def of_revisions(cls, revisions: Sequence[Revision]) -> Planned:
        """Return the entries of the newest plan; empty without a plan."""
        if not revisions:
            return cls()
        newest = revisions[-1]
        contents = {str(entry["name"]): entry for entry in _entries(newest)}
        blocks = {entry.name: _blocks_of(entry.name, newest) for entry in newest.entries}
        return cls(
            contents,
            {entry.name: entry for entry in newest.entries},
            {name: _planned_runs(own.values()) for name, own in blocks.items()},
            {
                name: frozenset(newest.owners[n]["uid"] for n in own if n in newest.owners)
                for name, own in blocks.items()
            },
            newest.plan.total,
        )

    def of(self, item: Object) -> Entry | str | None:
        """Return the planned entry of a Configuration, or the problem; None if not planned."""
        name = entry_name(item)
        if name not in self.contents or name not in self.expanded:
            return None
        if self.owners[name] and item["metadata"]["uid"] not in self.owners[name]:
            return TAKEN
        try:
            (now,) = added_entries([item])
        except ValidationError as error:
            return invalid_configuration(error)
        return self.expanded[name] if now == self.contents[name] else CHANGED


def _entries(revision: Revision) -> list[Object]:
    """Return the entries of a plan's document.

    Raises:
        InputError: it is none.
    """
    found = _document(revision).get("configuration") or [{"name": DEFAULT_ENTRY.name}]
    if not isinstance(found, list) or not all(text(mapping(e).get("name")) for e in found):
        raise _no_plan(revision.config_map, "the .vast file has no list of configurations")
    return found


def _document(revision: Revision) -> Object:
    """Return the document of a plan.

    Raises:
        InputError: it is none.
    """
    try:
        found = parse_yaml(revision.document)
    except ValueError as error:
        raise _no_plan(revision.config_map, f"the .vast file is invalid: {error}") from error
    if not isinstance(found, dict):
        raise _no_plan(revision.config_map, "the .vast file is not a mapping")
    return found


def any_plan(config_maps: Iterable[Object], prefix: str) -> CampaignPlan | None:
    """Return any plan in a campaign's ConfigMaps, also of the compose Job; else None.

    An unreadable plan is reported where it is needed, by `read_revisions`.
    """
    for obj in config_maps:
        if obj["metadata"]["name"].startswith(prefix):
            with suppress(ValueError):
                return CampaignPlan.model_validate_json(
                    text(mapping(obj.get("data")).get(PLAN_FILE))
                )
    return None


def read_revisions(config_maps: Iterable[Object], prefix: str) -> list[Revision]:
    """Return the plans in a campaign's ConfigMaps, oldest first.

    Args:
        config_maps: of the campaign.
        prefix: what the names of those with a plan begin with.

    Raises:
        InputError: one of them is no plan.
    """
    found = []
    for obj in config_maps:
        name: str = obj["metadata"]["name"]
        number = name.removeprefix(prefix)
        if name.startswith(prefix) and number.isdecimal() and len(number) < 10:
            found.append(_revision(int(number), name, obj))
    return sorted(found, key=lambda revision: revision.number)


def _revision(number: int, name: str, obj: Object) -> Revision:
    """Return the plan in a ConfigMap.

    Raises:
        InputError: it is none.
    """
    data = mapping(obj.get("data"))
    notes = obj["metadata"].get("annotations", {}).get(OWNERS_ANNOTATION, "{}")
    try:
        plan = CampaignPlan.model_validate_json(data.get(PLAN_FILE, ""))
        owners = {int(b): _Owner.model_validate(o) for b, o in json.loads(notes).items()}
    except (ValueError, TypeError, AttributeError) as error:
        raise _no_plan(name, str(error)) from error
    if plan.plan is None or not plan.plan.blocks:
        raise _no_plan(name, "the plan contains no runs")
    held = {block: owner.model_dump() for block, owner in owners.items()}
    document = text(data.get(DOCUMENT_FILE))
    return Revision(number, name, plan.plan, plan.entries, held, document, plan.composed)


def _no_plan(name: str, why: str) -> InputError:
    return InputError(
        f"ConfigMap {name} is not the plan that the operator created: {clause(why)}",
        hint="restore the ConfigMap from a backup, or create another Campaign. Stored results "
        "stay in the bucket",
    )


class _Owner(BaseModel):
    """Reference to the object that runs belong to."""

    model_config = ConfigDict(extra="allow")

    name: str
    uid: str


def next_revision(
    accepted: Accepted,
    revisions: Sequence[Revision],
    additions: Sequence[Addition],
    name: str,
) -> Revision | None:
    """Return the plan to add; None if the newest plan covers all requested runs.

    Args:
        accepted: the campaign, with its entries.
        revisions: the plans so far, oldest first.
        additions: Configurations in addition to the document's own.
        name: of the new plan's ConfigMap.
    """
    if not revisions:
        first = first_blocks(accepted.entries, accepted.runs)
        execution = accepted.vast.execution
        plan = PlanSpec(
            blocks=first,
            runs_per_job=execution.runs_per_start,
            breaks=accepted.breaks,
            by_variant=accepted.as_needed,
            rounds=() if execution.packs_are_measured else None,
        )
        text, composed = accepted.document_text, accepted.composed
        return Revision(0, name, plan, accepted.entries, {}, text, composed)
    newest = revisions[-1]
    if accepted.is_search:
        return _with_other_end(accepted, newest, name)
    document = _with_entries(newest, additions)
    owners = dict(newest.owners)
    blocks = list(newest.plan.blocks)
    entries = list(newest.entries)
    _raise_runs(blocks, sum(entry.variants for entry in accepted.entries), accepted.runs)
    for addition in additions:
        _add(addition, blocks, entries, owners)
    if len(blocks) == len(newest.plan.blocks):
        return None
    total = sum(block.size for block in blocks)
    if total > RUNS_LIMIT:
        raise InputError(
            f"The campaign and the added Configurations would have {total:,} runs, but at most "
            f"{RUNS_LIMIT:,} are allowed",
            hint="lower `runs`",
        )
    plan = newest.plan.model_copy(update={"blocks": tuple(blocks)})
    plan = PlanSpec.model_validate(plan.model_dump())
    return Revision(newest.number + 1, name, plan, tuple(entries), owners, document)


def _with_other_end(accepted: Accepted, newest: Revision, name: str) -> Revision | None:
    """Return the plan of a search with a changed end; None if the end is as planned.

    Its runs are those of the newest plan: Jobs that propose read it from then on.
    """
    text = accepted.document_text
    if text == newest.document or not same_document(newest.document, accepted.spec.vast):
        return None
    return replace(newest, number=newest.number + 1, config_map=name, document=text)


def as_planned(accepted: Accepted, revision: Revision) -> Accepted:
    """Return A campaign whose document is that of a plan, with all added entries."""
    added = [entry.name for entry in revision.entries[len(accepted.entries) :]]
    select = accepted.spec.select and [*accepted.spec.select, *added]
    spec = accepted.spec.model_copy(update={"select": select})
    composed = revision.composed or accepted.composed
    return replace(accepted, spec=spec, document_text=revision.document, composed=composed)


def _with_entries(newest: Revision, additions: Sequence[Addition]) -> str:
    """Return the document of the newest plan plus the additions; planned entries keep their places.

    Run ids follow from the order of all entries, even of Configurations that were deleted since.
    """
    if not additions:
        return newest.document
    entries = _entries(newest)
    names = {entry["name"] for entry in entries}
    new = [addition.content for addition in additions if addition.name not in names]
    if not new:
        return newest.document
    return dump_yaml({**_document(newest), "configuration": [*entries, *new]})


def _raise_runs(blocks: list[Block], variants: int, runs: int) -> None:
    """Add runs of the document's own variants."""
    planned = _planned_runs(b for b in blocks if b.first_variant == 0)
    if runs > planned:
        more = Block(first_variant=0, variants=variants, first_run=planned, runs=runs - planned)
        blocks.append(more)


def _planned_runs(blocks: Iterable[Block]) -> int:
    """Return the number of runs of each variant in the blocks of one entry."""
    return max((block.first_run + block.runs for block in blocks), default=0)


def _blocks_of(name: str, revision: Revision) -> dict[int, Block]:
    """Return the blocks of an entry that a Configuration has added, by their number."""
    before = takewhile(lambda entry: entry.name != name, revision.entries)
    first = sum(entry.variants for entry in before)
    return {n: b for n, b in enumerate(revision.plan.blocks) if b.first_variant == first}


def _add(
    addition: Addition, blocks: list[Block], entries: list[Entry], owners: dict[int, Object]
) -> None:
    """Add the runs of a Configuration, with variants after all other variants."""
    if all(entry.name != addition.name for entry in entries):
        entries.append(addition.expanded)
    before = takewhile(lambda entry: entry.name != addition.name, entries)
    first = sum(entry.variants for entry in before)
    planned = _planned_runs(b for b in blocks if b.first_variant == first)
    if addition.runs > planned:
        owners[len(blocks)] = addition.owner
        blocks.append(
            Block(
                first_variant=first,
                variants=addition.expanded.variants,
                first_run=planned,
                runs=addition.runs - planned,
            )
        )


def owners_note(revision: Revision) -> dict[str, str]:
    """Return the annotation with the owners of blocks."""
    if not revision.owners:
        return {}
    return {OWNERS_ANNOTATION: json.dumps(revision.owners)}

"""Plans of a campaign: the first one, and what is appended to it. Pure functions."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from pydantic import BaseModel, ConfigDict

from robovast.base.errors import InputError
from robovast.model.packs import Block, CampaignPlan, Entry, PlanSpec, first_blocks
from robovast_operator.kube.lenient import mapping, text
from robovast_operator.planning.campaign import Accepted, Object, Revision

OWNERS_ANNOTATION = "robovast.io/owners"
"""References to the Configurations that blocks belong to, by number of the block, as JSON."""


NO_PLAN = PlanSpec(blocks=())
"""Of the compose Job, which finds out what there is to plan."""


@dataclass(frozen=True)
class Addition:
    """A Configuration that was applied by hand, and what it expands to."""

    name: str
    """Of the entry."""
    variants: int
    runs: int
    owner: Object
    """Reference to the object."""


def any_plan(config_maps: Iterable[Object], prefix: str) -> CampaignPlan | None:
    """A plan in a campaign's ConfigMaps, also the compose Job's; None when there is none yet.

    One that is none is told where it is needed: `read_revisions`.
    """
    for obj in config_maps:
        if obj["metadata"]["name"].startswith(prefix):
            with suppress(ValueError):
                return CampaignPlan.model_validate_json(
                    text(mapping(obj.get("data")).get("campaign.json"))
                )
    return None


def read_revisions(config_maps: Iterable[Object], prefix: str) -> list[Revision]:
    """The plans in a campaign's ConfigMaps, oldest first.

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
    """The plan in a ConfigMap.

    Raises:
        InputError: it is none.
    """
    data = mapping(obj.get("data"))
    notes = obj["metadata"].get("annotations", {}).get(OWNERS_ANNOTATION, "{}")
    try:
        plan = CampaignPlan.model_validate_json(data.get("campaign.json", ""))
        owners = {int(b): _Owner.model_validate(o) for b, o in json.loads(notes).items()}
    except (ValueError, TypeError, AttributeError) as error:
        raise _no_plan(name, str(error)) from error
    if plan.plan is None or not plan.plan.blocks:
        raise _no_plan(name, "it plans no run")
    held = {block: owner.model_dump() for block, owner in owners.items()}
    document = text(data.get("document.vast"))
    return Revision(number, name, plan.plan, plan.entries, held, document, plan.composed)


def _no_plan(name: str, why: str) -> InputError:
    return InputError(
        f"the ConfigMap {name} is not the plan that the operator made: {why}. Put it back from a "
        "backup, or create another Campaign: what is stored stays in its bucket."
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
    """The plan that must be added, or None when the newest one covers all that is asked for.

    Args:
        accepted: the campaign, with its entries.
        revisions: the plans so far, oldest first.
        additions: Configurations beside the document's own.
        name: of the new plan's ConfigMap.
    """
    if not revisions:
        first = first_blocks(accepted.entries, accepted.runs)
        runs_per_job = accepted.vast.execution.runs_per_job
        plan = PlanSpec(blocks=first, runs_per_job=runs_per_job, breaks=accepted.breaks)
        text, composed = accepted.document_text, accepted.composed
        return Revision(0, name, plan, accepted.entries, {}, text, composed)
    newest = revisions[-1]
    owners = dict(newest.owners)
    blocks = list(newest.plan.blocks)
    entries = list(newest.entries)
    _raise_runs(blocks, sum(entry.variants for entry in accepted.entries), accepted.runs)
    for addition in additions:
        _add(addition, blocks, entries, owners)
    if len(blocks) == len(newest.plan.blocks):
        return None
    plan = newest.plan.model_copy(update={"blocks": tuple(blocks)})
    plan = PlanSpec.model_validate(plan.model_dump())
    number, text = newest.number + 1, accepted.document_text
    return Revision(number, name, plan, tuple(entries), owners, text)


def _raise_runs(blocks: list[Block], variants: int, runs: int) -> None:
    """More runs of the document's own variants."""
    planned = max((b.first_run + b.runs for b in blocks if b.first_variant == 0), default=0)
    if runs > planned:
        more = Block(first_variant=0, variants=variants, first_run=planned, runs=runs - planned)
        blocks.append(more)


def _add(
    addition: Addition, blocks: list[Block], entries: list[Entry], owners: dict[int, Object]
) -> None:
    """Runs of a Configuration: its variants come after all others."""
    known = next((i for i, entry in enumerate(entries) if entry.name == addition.name), None)
    if known is None:
        first, planned = sum(entry.variants for entry in entries), 0
        entries.append(Entry(name=addition.name, variants=addition.variants))
    else:
        first = sum(entry.variants for entry in entries[:known])
        own = [b for b in blocks if b.first_variant == first]
        planned = max((b.first_run + b.runs for b in own), default=0)
    if addition.runs > planned:
        owners[len(blocks)] = addition.owner
        blocks.append(
            Block(
                first_variant=first,
                variants=addition.variants,
                first_run=planned,
                runs=addition.runs - planned,
            )
        )


def owners_note(revision: Revision) -> dict[str, str]:
    """The annotation that keeps the owners of blocks."""
    if not revision.owners:
        return {}
    return {OWNERS_ANNOTATION: json.dumps(revision.owners)}

"""Configuration objects: one for each entry of a document, and those that add runs. Pure."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Sequence
from typing import Any

from robovast.cluster.plan import Block, Entry
from robovast.cluster.ranges import Span, clip, count, parse_ranges
from robovast.cluster.resources import API_VERSION, ConfigurationSpec
from robovast.cluster.status import CampaignStatus, ConfigurationStatus, Runs, read_status
from robovast_operator.campaign import Accepted, Identity, Object, Revision
from robovast_operator.conditions import Found, dated, is_true

NAME_LIMIT = 200


def object_name(campaign: str, entry: str) -> str:
    """Name of the Configuration of an entry, whose own name may have other characters."""
    slug = re.sub(r"[^a-z0-9-]+", "-", entry.lower()).strip("-")
    if slug != entry:
        slug = f"{slug}-{hashlib.sha256(entry.encode()).hexdigest()[:6]}".strip("-")
    return f"{campaign}-{slug}"[:NAME_LIMIT]


def own_configurations(accepted: Accepted) -> list[Object]:
    """The Configurations of a document's entries."""
    written = accepted.spec.vast.get("configuration") or [{"name": "config1"}]
    selected = {entry.name for entry in accepted.entries}
    return [
        _own(accepted.identity, entry)
        for entry in written
        if entry["name"] in selected or not selected
    ]


def _own(identity: Identity, entry: dict[str, Any]) -> Object:
    kept = {key: entry[key] for key in ("parameters", "variations") if entry.get(key) is not None}
    return {
        "apiVersion": API_VERSION,
        "kind": "Configuration",
        "metadata": {
            "name": object_name(identity.name, entry["name"]),
            "namespace": identity.namespace,
            "labels": identity.labels,
            "ownerReferences": [identity.owner],
        },
        "spec": {"campaign": identity.name, "name": entry["name"], **kept},
    }


def is_own(obj: Object, identity: Identity) -> bool:
    """Whether the operator made a Configuration."""
    owners = obj["metadata"].get("ownerReferences") or ()
    return any(owner["uid"] == identity.uid for owner in owners)


def entry_name(obj: Object) -> str:
    """Name of the entry that a Configuration stands for."""
    return str(obj["spec"].get("name") or obj["metadata"]["name"])


def added_entries(added: Iterable[Object]) -> list[dict[str, Any]]:
    """Entries of a document for Configurations that were applied by hand.

    Raises:
        ValidationError: (of pydantic) a spec is not in order.
    """
    made = []
    for obj in added:
        spec = ConfigurationSpec.model_validate(obj["spec"])
        given = {"parameters": spec.parameters, "variations": spec.variations}
        kept = {key: value for key, value in given.items() if value is not None}
        made.append({"name": entry_name(obj), **kept})
    return made


def reference(obj: Object) -> Object:
    """Which Configuration runs belong to, as the plan keeps it."""
    return {
        "apiVersion": API_VERSION,
        "kind": "Configuration",
        "name": obj["metadata"]["name"],
        "uid": obj["metadata"]["uid"],
    }


def configuration_status(
    obj: Object, revision: Revision, status: CampaignStatus, now: str, problem: str = ""
) -> ConfigurationStatus:
    """The status of a Configuration.

    Args:
        obj: the Configuration.
        revision: the newest plan of its campaign.
        status: of its campaign.
        now: the time.
        problem: why its runs cannot be added.
    """
    old = read_status(ConfigurationStatus, obj.get("status"))
    generation = obj["metadata"].get("generation", 0)
    truth: Found = ("Accepted", "True", "Valid", "")
    if problem:
        truth = ("Accepted", "False", "Invalid", problem)
    spans, variants = _spans(entry_name(obj), revision.entries, revision.plan.blocks)
    return ConfigurationStatus(
        observed_generation=generation,
        variants=variants,
        **_numbers(spans, status),
        conditions=dated([truth], generation, now, old.conditions),
    )


def _numbers(spans: Sequence[Span], status: CampaignStatus) -> dict[str, Any]:
    """The numbers of some runs of a campaign; undecided when not all ids of bad runs are told."""
    total = count(spans)
    if not is_true(status, "ResultsAvailable"):
        runs = Runs(total=total)
    elif status.ranges_truncated:
        runs = Runs(total=total, undecided=total)
    else:
        failed, errored = (
            sum(count(clip(parse_ranges(text), first, last)) for first, last in spans)
            for text in (status.failed_runs, status.errored_runs)
        )
        passed = total - failed - errored
        runs = Runs(
            total=total, passed=passed, failed=failed, errored=errored, stored=passed + failed
        )
    return {"runs": runs, "progress": f"{runs.decided}/{total}"}


def _spans(name: str, entries: Sequence[Entry], blocks: Sequence[Block]) -> tuple[list[Span], int]:
    """The run ids of an entry, and how many variants it has."""
    first_variant = 0
    for entry in entries:
        if entry.name == name:
            break
        first_variant += entry.variants
    else:
        return [], 0
    spans: list[Span] = []
    first_id = 0
    for block in blocks:
        low = max(first_variant, block.first_variant)
        high = min(first_variant + entry.variants, block.first_variant + block.variants)
        if low < high:
            begin = first_id + (low - block.first_variant) * block.runs
            spans.append((begin, begin + (high - low) * block.runs - 1))
        first_id += block.size
    return spans, entry.variants

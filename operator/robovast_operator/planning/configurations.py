"""Configuration objects: one for each entry, and those that add runs. Pure functions."""

from __future__ import annotations

import hashlib
import re
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate
from typing import Any

from pydantic import ValidationError

from robovast.base.ranges import Span, clip, count, parse_ranges
from robovast.kubeapi.resources import API_VERSION, ENTRY_KEYS, ConfigurationSpec
from robovast.kubeapi.status import CampaignStatus, ConfigurationStatus, Runs, read_status
from robovast.model.packs import Block, Entry
from robovast_operator.kube.conditions import Found, dated, is_true
from robovast_operator.kube.objects import Identity, Object
from robovast_operator.kube.sentences import sentence, with_remedy
from robovast_operator.planning.campaign import Accepted, Revision

NAME_LIMIT = 200


NOT_FOUND, NOT_ACCEPTED = "CampaignNotFound", "CampaignNotAccepted"

WAITING = {
    NOT_FOUND: "Campaign {} does not exist in this namespace. Create the Campaign.",
    NOT_ACCEPTED: "Campaign {} is not accepted. Read the condition Accepted of the Campaign.",
}
"""What a Configuration waits for, by reason."""


def object_name(campaign: str, entry: str) -> str:
    """Name of the Configuration of an entry, whose own name may have other characters."""
    slug = re.sub(r"[^a-z0-9-]+", "-", entry.lower()).strip("-")
    if slug != entry:
        slug = f"{slug}-{hashlib.sha256(entry.encode()).hexdigest()[:6]}".strip("-")
    return f"{campaign}-{slug}"[:NAME_LIMIT]


def own_configurations(accepted: Accepted) -> list[Object]:
    """Return the Configurations of a document's entries; a search has none."""
    if accepted.is_search:
        return []
    written = accepted.spec.vast.get("configuration") or [{"name": "config1"}]
    selected = {entry.name for entry in accepted.entries}
    return [
        _own(accepted.identity, entry)
        for entry in written
        if entry["name"] in selected or not selected
    ]


def _own(identity: Identity, entry: dict[str, Any]) -> Object:
    kept = {key: entry[key] for key in ENTRY_KEYS if entry.get(key) is not None}
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
    """Return whether the operator created a Configuration."""
    return any(owner["uid"] == identity.uid for owner in _owners(obj))


def is_owned(obj: Object) -> bool:
    """Return whether a Configuration goes with a Campaign, even if that is gone already."""
    return any(owner.get("kind") == "Campaign" for owner in _owners(obj))


def _owners(obj: Object) -> Sequence[Object]:
    return obj["metadata"].get("ownerReferences") or ()


def waiting_status(obj: Object, reason: str, now: str) -> ConfigurationStatus | None:
    """Return the status of a Configuration without a campaign; None if it is already set.

    It has no `observedGeneration`, so its campaign answers it as soon as it can.

    Args:
        obj: the Configuration.
        reason: of `WAITING`.
        now: the time.
    """
    generation = obj["metadata"].get("generation", 0)
    conditions = (obj.get("status") or {}).get("conditions") or ()
    if any((c["reason"], c.get("observedGeneration")) == (reason, generation) for c in conditions):
        return None
    old = read_status(ConfigurationStatus, obj.get("status"))
    truth: Found = ("Accepted", "Unknown", reason, WAITING[reason].format(obj["spec"]["campaign"]))
    return ConfigurationStatus(conditions=dated([truth], generation, now, old.conditions))


def entry_name(obj: Object) -> str:
    """Return the name of the entry of a Configuration."""
    return str(obj["spec"].get("name") or obj["metadata"]["name"])


def added_entries(added: Iterable[Object]) -> list[dict[str, Any]]:
    """Return entries of a document for Configurations that were applied by hand.

    Raises:
        ValidationError: (of pydantic) a spec is invalid.
    """
    made = []
    for obj in added:
        spec = ConfigurationSpec.model_validate(obj["spec"])
        given = {key: getattr(spec, key) for key in ENTRY_KEYS}
        kept = {key: value for key, value in given.items() if value is not None}
        made.append({"name": entry_name(obj), **kept})
    return made


FIX_CONFIGURATION = "Fix the spec and apply the Configuration again."


def invalid_configuration(error: ValidationError) -> str:
    """Return the message about a Configuration whose spec is invalid."""
    problems = spec_message(error)
    return with_remedy("The spec of the Configuration is invalid", problems, FIX_CONFIGURATION)


def spec_message(error: ValidationError) -> str:
    """Return the problems of a spec, one per line, each with the key."""
    lines = []
    for problem in error.errors():
        where = ".".join(str(part) for part in ("spec", *problem["loc"]))
        lines.append(f"{where}: {problem['msg'].removeprefix('Value error, ')}")
    return "\n".join(lines)


def reference(obj: Object) -> Object:
    """Return the reference to a Configuration in the format of a plan."""
    return {
        "apiVersion": API_VERSION,
        "kind": "Configuration",
        "name": obj["metadata"]["name"],
        "uid": obj["metadata"]["uid"],
    }


class ConfigurationStatuses:
    """The statuses of a campaign's Configurations, of which there may be thousands."""

    def __init__(
        self, revision: Revision, status: CampaignStatus, now: str, problems: Mapping[str, str]
    ) -> None:
        """
        Args:
            revision: the newest plan of the campaign.
            status: of the campaign.
            now: the time.
            problems: by Configuration, why its runs cannot be added.
        """
        self._status = status
        self._now = now
        self._problems = problems
        self._variants = {entry.name: entry.variants for entry in revision.entries}
        self._spans = _spans(revision.entries, revision.plan.blocks)
        self._failed = parse_ranges(status.failed_runs)
        self._errored = parse_ranges(status.errored_runs)

    def of(self, obj: Object) -> ConfigurationStatus:
        """Return the status of a Configuration."""
        old = read_status(ConfigurationStatus, obj.get("status"))
        generation = obj["metadata"].get("generation", 0)
        problem, name = self._problems.get(obj["metadata"]["name"], ""), entry_name(obj)
        truth: Found = ("Accepted", "True", "Valid", "")
        if problem:
            message = sentence(problem, "The Configuration is invalid: ")
            truth = ("Accepted", "False", "Invalid", message)
        runs = self._runs(self._spans.get(name, []))
        return ConfigurationStatus(
            observed_generation=generation,
            variants=self._variants.get(name, 0),
            runs=runs,
            progress=f"{runs.decided}/{runs.needed}",
            conditions=dated([truth], generation, self._now, old.conditions),
        )

    def _runs(self, spans: Sequence[Span]) -> Runs:
        """Count the runs of some spans; undecided if the status lists not all unsuccessful runs.

        Nor does it list runs that are not needed: the index in the bucket has the others.
        """
        total = count(spans)
        if not is_true(self._status, "ResultsAvailable"):
            return Runs(total=total)
        if total == self._status.runs.total:
            return self._status.runs
        if self._status.ranges_truncated or self._status.runs.not_needed:
            return Runs(total=total, undecided=total)
        failed, errored = (
            sum(count(clip(bad, first, last)) for first, last in spans)
            for bad in (self._failed, self._errored)
        )
        passed = total - failed - errored
        return Runs(
            total=total, passed=passed, failed=failed, errored=errored, stored=passed + failed
        )


def _spans(entries: Sequence[Entry], blocks: Sequence[Block]) -> dict[str, list[Span]]:
    """Return the run ids of each entry."""
    starts = list(accumulate((entry.variants for entry in entries), initial=0))
    found: dict[str, list[Span]] = {entry.name: [] for entry in entries}
    first_id = 0
    for block in blocks:
        end = block.first_variant + block.variants
        for index in range(bisect_right(starts, block.first_variant) - 1, len(entries)):
            low, high = max(starts[index], block.first_variant), min(starts[index + 1], end)
            if low >= high:
                break
            begin = first_id + (low - block.first_variant) * block.runs
            found[entries[index].name].append((begin, begin + (high - low) * block.runs - 1))
        first_id += block.size
    return found

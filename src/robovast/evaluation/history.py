"""One configuration in all campaigns of a results folder: how often it failed, and what changed.

A configuration is recognized by its parameters, as in comparisons, or by its name where it has
none. In campaigns of one document its name is the same, so that only its own runs are read. For
others there is an index of names by parameters (`ConfigurationIndex`).
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from robovast.base.serialization import fingerprint
from robovast.base.statistics import anytime, wilson
from robovast.campaign.decisions import recorded_test
from robovast.campaign.layout import EXECUTION_RECORD, SCENARIO_CONFIG, VARIANT_RECORD
from robovast.campaign.planned_runs import is_fixed, planned_runs
from robovast.campaign.verdict import Verdict
from robovast.evaluation.campaign_inputs import digests, read_document
from robovast.evaluation.campaigns import find_campaigns, is_search
from robovast.evaluation.configuration_index import ConfigurationIndex
from robovast.evaluation.confined_files import MissingError
from robovast.evaluation.rates import Rate, rate_of
from robovast.evaluation.run import run_record
from robovast.evaluation.stored_runs import read_variant
from robovast.evaluation.summaries import VariantRuns, seconds
from robovast.evaluation.untrusted_data import mapping, read_yaml
from robovast.model.naming import CONFIG

MOST_NAMED = 4
"""Changes that are named in a text."""

Progress = Callable[[str, int, int], None]
"""Takes a campaign's name, its place, and the number of campaigns."""


@dataclass(frozen=True)
class HistoryEntry:
    """A configuration in one campaign."""

    campaign: str
    name: str
    """Its name there."""
    started_at: float | None
    """Of the campaign, or of its first run [s since the epoch]."""
    rate: Rate
    reason: str
    """The most frequent reason of its bad runs."""
    image: str
    changes: tuple[str, ...]
    """What is different from the entry before: `image`, `environment`, `RoboVAST`, `seed`,
    `parameters`, `scenario`, `.vast`, and paths of other files."""
    changed: str
    """The same for people; it also states that nothing changed. Empty for the first entry."""


@dataclass(frozen=True)
class History:
    """A configuration over campaigns."""

    parameters: Mapping[str, Any]
    entries: Sequence[HistoryEntry]
    """The oldest first; the campaigns that have it and runs of it with a verdict."""
    others: Sequence[str]
    """Campaigns without it in which its name stands for other parameters."""
    pending: int
    """Campaigns that could not be searched in time."""


@dataclass(frozen=True)
class _Found:
    entry: HistoryEntry
    inputs: Mapping[str, str]
    """All that is recorded of what was run, by the label that marks a change."""


def history(
    results: Path,
    campaign: str,
    name: str,
    index: ConfigurationIndex,
    *,
    limit: float = float("inf"),
    progress: Progress = lambda *_: None,
) -> History:
    """Find a configuration in all campaigns of a results folder.

    Args:
        results: the results folder, without links.
        campaign: one that has it.
        name: its name there.
        index: finds it where it has another name.
        limit: how long campaigns that the index does not know may be read [s].
        progress: is told which campaign is searched.

    Raises:
        InputError: the campaign has no such configuration.
    """
    wanted = _read(results, campaign, name)
    if wanted is None:
        raise MissingError(
            f"{campaign} has no configuration {name}.",
            hint="use the name of a configuration folder",
        )
    until = time.monotonic() + limit
    found, others, pending = [], [], 0
    names = find_campaigns(results)
    for place, other in enumerate(names, start=1):
        progress(other, place, len(names))
        variant = _read(results, other, name)
        is_other = variant is not None and identity(variant) != identity(wanted)
        if variant is None or is_other:
            known = index.find(results / other, identity(wanted), until)
            pending += known is None
            variant = _read(results, other, known) if known else None
            if variant is not None and identity(variant) != identity(wanted):
                variant = None  # the index is older than what is there
        if variant is not None and (entry := _found(results, other, variant)):
            found.append(entry)
        elif is_other:
            others.append(other)
    return History(wanted.parameters, list(_with_changes(found)), others, pending)


def latest_with(results: Path, name: str) -> str:
    """The latest campaign that has a configuration of a name.

    Raises:
        InputError: there is none.
    """
    for campaign in find_campaigns(results):
        if _read(results, campaign, name) is not None:
            return campaign
    raise MissingError(
        f"no campaign in {results} has a configuration `{name}`",
        hint="use the name of a configuration folder, or set the results folder with `-r`",
    )


def identity(variant: VariantRuns) -> str:
    """Equal for configurations of equal parameters."""
    return fingerprint(variant.parameters) if variant.parameters else variant.name


def _read(results: Path, campaign: str, name: str) -> VariantRuns | None:
    if "/" in name or name.startswith((".", "_")):
        return None
    try:
        return read_variant(results, campaign, name)
    except OSError:
        return None


def _found(results: Path, campaign: str, variant: VariantRuns) -> _Found | None:
    """None without a run that has a verdict, and of a replay, which repeats a counted run."""
    execution = read_yaml(results, f"{campaign}/{EXECUTION_RECORD}")
    if "replay_of" in execution:
        return None
    planned = planned_runs(execution)
    fixed = (
        recorded_test(execution) is None
        and is_fixed(execution)
        and not is_search(results, campaign)
        and all(run.verdict is not Verdict.INTERRUPTED for run in variant.runs)
        and planned.of(variant.name) <= len(variant.runs)
    )
    rate = rate_of([variant], wilson if fixed else anytime)
    if not rate.runs:
        return None
    begins = [run.started_at for run in variant.runs if run.started_at is not None]
    started = seconds(execution.get("execution_time"))
    bad = [run.reason for run in variant.runs if run.verdict in (Verdict.FAILED, Verdict.ERRORED)]
    record = run_record(results, f"{campaign}/{variant.name}/{variant.runs[0].number}")
    image = str(record.get("image") or "")
    entry = HistoryEntry(
        campaign=campaign,
        name=variant.name,
        started_at=min(begins, default=None) if started is None else started,
        rate=rate,
        reason=Counter(bad).most_common(1)[0][0] if bad else "",
        image=image,
        changes=(),
        changed="",
    )
    known = {
        "image": record.get("image_digest") or image,
        "environment": [record.get("runtime"), execution.get("env")],
        "RoboVAST": execution.get("robovast_version"),
        "seed": variant.runs[0].seed,
        "parameters": [variant.parameters, variant.stated],
    }
    inputs = {label: fingerprint(value) for label, value in known.items()}
    return _Found(entry, inputs | _files(results, campaign, variant.name))


def _files(results: Path, campaign: str, variant: str) -> dict[str, str]:
    """Digests of the files of a campaign and of a configuration: those that its runs used."""
    name, document = read_document(results, campaign)
    scenario = str(mapping(document.get("execution")).get("scenario_file", ""))
    labels = {scenario: "scenario", name: ".vast"}
    own = digests(results, f"{campaign}/{variant}/{CONFIG}")
    for record in (VARIANT_RECORD, SCENARIO_CONFIG):  # made of the others
        own.pop(record.rpartition("/")[2], None)
    found = {**own, **digests(results, f"{campaign}/{CONFIG}")}
    ordered = sorted(found, key=lambda path: (path not in labels, path == name, path))
    return {labels.get(path, path): found[path] for path in ordered}


def _with_changes(found: Sequence[_Found]) -> Iterator[HistoryEntry]:
    """Entries by date, each with what is different from the one before."""
    ordered = sorted(found, key=lambda one: (one.entry.started_at or 0.0, one.entry.campaign))
    before = ordered[0].inputs if ordered else {}
    for place, one in enumerate(ordered):
        labels = dict.fromkeys([*one.inputs, *before])
        changed = [key for key in labels if one.inputs.get(key) != before.get(key)]
        text = _changed(changed) if place else ""
        yield replace(one.entry, changes=tuple(changed), changed=text)
        before = one.inputs


def _changed(changes: Sequence[str]) -> str:
    if not changes:
        return "nothing recorded changed"
    more = f" and {len(changes) - MOST_NAMED} more" if len(changes) > MOST_NAMED else ""
    return ", ".join(changes[:MOST_NAMED]) + more

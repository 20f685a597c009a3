"""`finish`: completes and summarizes a campaign's bucket after its last pod has ended."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict
from datetime import UTC, datetime
from itertools import islice
from typing import Any

from robovast.agent.bucket import Bucket
from robovast.agent.campaign import PodCampaign, expand, load_inputs, open_campaign, open_composed
from robovast.agent.check import check_runs
from robovast.agent.compose import store_inputs
from robovast.agent.composed import ComposedVariants
from robovast.agent.mounts import Folders
from robovast.agent.pod_facts import completed, read_sightings
from robovast.agent.untrusted_files import SIDE_BY_SIDE, store_own_tree
from robovast.base.errors import CannotRunError
from robovast.base.printable import printable
from robovast.base.ranges import spans
from robovast.base.sequential import Decision
from robovast.base.serialization import dump_yaml
from robovast.campaign.decisions import DECISIONS_LIMIT, decide, runs_needed
from robovast.campaign.layout import INDEX, JOB_LINKS, RUNS_TABLE, Layout
from robovast.campaign.run_record import IN_INDEX, RunRecord
from robovast.campaign.verdict import Verdict
from robovast.execution.generate import write_execution
from robovast.kubeapi.pod_contract.exit_codes import AgentExit
from robovast.kubeapi.pod_contract.messages import (
    SUMMARY_LIMIT,
    Repeat,
    Summary,
    id_ranges,
)
from robovast.kubeapi.status import FAILING_LIMIT
from robovast.model.document import Document
from robovast.model.expansion import Variant
from robovast.model.naming import EXECUTION, TRANSIENT, campaign_time
from robovast.model.plan import Run, plan_runs
from robovast.model.repetition import GroupSizes, list_key, list_name, list_text, retry_groups

NO_RESULT = "no pod of it has stored a result"
NOT_DECIDED = (
    "no pod stored a result of the run, and its configuration is inconclusive: repeat "
    "unsuccessful runs to continue"
)


def finish(folders: Folders) -> AgentExit:
    """Store a campaign's files beside its runs, such as `_execution/index.json`.

    Raises:
        InputError: the document, or a file that it needs, is wrong.
        StorageError: the bucket cannot be read or written.
    """
    campaign = open_campaign(folders, connections=SIDE_BY_SIDE)
    bucket = campaign.bucket
    bucket.claim()
    document, variants = _complete_inputs(campaign)
    runs = _runs(campaign, variants)
    sightings = read_sightings(folders.pods)
    with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
        seen = list(pool.map(lambda run: completed(bucket, run.path, sightings), runs))
    damaged = check_runs(bucket, {run.path: s for run, s in zip(runs, seen, strict=True)})
    for run, damage in damaged.items():
        print(printable(f"{run}: {damage}"))  # noqa: T201
    records = {run.id: record for run, (record, _) in zip(runs, seen, strict=True)}
    decisions = _decisions(campaign, document, runs, records)
    needed = [run for run in runs if records[run.id] is not None or not _is_over(decisions, run)]
    index = [_entry(run, records[run.id], damaged, decisions) for run in needed]
    stored = [record for record in records.values() if record is not None]
    _store_execution(campaign, document, bucket, index, stored, decisions)
    repeat = _store_bad_runs(campaign, bucket, index)
    needed_runs = runs_needed(decisions.values(), len(runs)) if decisions else ""
    summary(index, repeat, len(runs) - len(index), needed_runs).fitting().write(folders.message)
    return AgentExit.PASSED


def _decisions(
    campaign: PodCampaign,
    document: Document,
    runs: Iterable[Run],
    records: Mapping[int, RunRecord | None],
) -> dict[str, Decision]:
    """What is decided about each variant; nothing when the number of runs is fixed."""
    if document.vast.execution.test() is None or not campaign.packs.by_variant:
        return {}
    verdicts: dict[str, dict[int, Verdict]] = {}
    planned: Counter[str] = Counter()
    for run in runs:
        known = verdicts.setdefault(run.variant.name, {})
        planned[run.variant.name] += 1
        if (record := records[run.id]) is not None:
            known[run.number] = record.verdict
    tests = {most: document.vast.execution.test(most) for most in set(planned.values())}
    return {
        name: decide(test, known)
        for name, known in verdicts.items()
        if (test := tests[planned[name]]) is not None
    }


def _is_over(decisions: Mapping[str, Decision], run: Run) -> bool:
    decision = decisions.get(run.variant.name)
    return decision is not None and decision.is_over


def _complete_inputs(campaign: PodCampaign) -> tuple[Document, Sequence[Variant]]:
    if campaign.plan.expansion != "pure":
        document, variants = open_composed(campaign)
        return document, variants.outlines() if isinstance(variants, ComposedVariants) else variants
    document = load_inputs(campaign)
    composition = expand(campaign.plan, document, campaign.folders.scratch, print)
    store_inputs(campaign, document, composition)
    return document, composition.variants


def _runs(campaign: PodCampaign, variants: Sequence[Variant]) -> list[Run]:
    return plan_runs(campaign.packs, variants, campaign.plan.seed)


def _entry(
    run: Run,
    record: RunRecord | None,
    damaged: Mapping[str, str],
    decisions: Mapping[str, Decision],
) -> dict[str, Any]:
    """A run's entry in `index.json`; a run without a record is errored."""
    place = {"id": run.id, "variant": run.variant.name, "run": run.number}
    if record is None:
        reason = NOT_DECIDED if run.variant.name in decisions else NO_RESULT
        return {**place, "verdict": Verdict.ERRORED, "reason": reason, "attempt": 0}
    return {
        **place,
        **{name: getattr(record, name) for name in IN_INDEX},
        **({"missing": sum(file.count for file in record.missing)} if record.missing else {}),
        **({"damaged": damaged[run.path]} if run.path in damaged else {}),
    }


def _store_execution(
    campaign: PodCampaign,
    document: Document,
    bucket: Bucket,
    index: Iterable[Mapping[str, Any]],
    records: Sequence[RunRecord],
    decisions: Mapping[str, Decision],
) -> None:
    layout = Layout(campaign.folders.work / "executed")
    for folder in (layout.execution, layout.transient):
        folder.mkdir(parents=True, exist_ok=True)
    write_execution(
        layout,
        document,
        started=(campaign_time(campaign.plan.campaign) or datetime.now(UTC)).replace(tzinfo=UTC),
        runs=campaign.plan.runs,
        seed=campaign.plan.seed,
        kind="cluster",
        image=campaign.plan.image,
        image_revision="",
        added=any(block.first_run for block in campaign.packs.blocks),
        test=document.vast.execution.test(campaign.plan.runs),
    )
    links = {f"{item['variant']}/{item['run']}": item["job"] for item in index if "job" in item}
    (layout.root / JOB_LINKS).write_text(dump_yaml(links), encoding="utf-8")
    content: dict[str, Any] = {"campaign": campaign.plan.campaign, "runs": index}
    if decisions:
        content["decisions"] = {name: asdict(one) for name, one in decisions.items()}
    text = json.dumps(content, indent=1)
    (layout.root / INDEX).write_text(text + "\n", encoding="utf-8")
    _write_runs(layout, records)
    prefixes = (f"{EXECUTION}/", f"{TRANSIENT}/")
    there = {o.key for prefix in prefixes for o in bucket.store.objects(bucket.name, prefix)}
    store_own_tree(bucket, layout.root, there=there)


def _write_runs(layout: Layout, records: Sequence[RunRecord]) -> None:
    """Write the rows of all runs, which are then asked in the bucket, without a download.

    A smaller image without DuckDB writes none; who asks then reads the index.
    """
    from robovast.analysis.tables.columnar import write_runs
    from robovast.analysis.tables.runs import record_rows

    with suppress(CannotRunError):
        write_runs(layout.root / RUNS_TABLE, list(record_rows(records)))


def _store_bad_runs(
    campaign: PodCampaign, bucket: Bucket, index: Iterable[Mapping[str, Any]]
) -> Repeat | None:
    """Store the ids of all bad runs; returns the list's name and the sizes of a retry's groups.

    The name follows from the ids, so a list that pods are working from never changes.
    """
    bad = spans(item["id"] for item in index if item["verdict"] is not Verdict.PASSED)
    if not bad:
        return None
    text = list_text(bad)
    name = list_name(text)
    bucket.store.put_bytes(bucket.name, list_key(name), text.encode())
    sizes = GroupSizes.of(retry_groups(campaign.packs, bad))
    return Repeat(list=name, sizes=str(sizes))


def summary(
    index: Sequence[Mapping[str, Any]],
    repeat: Repeat | None = None,
    not_needed: int = 0,
    decisions: str = "",
) -> Summary:
    """Counts, ranges of bad runs and the first of them, from the entries of `index.json`.

    Args:
        index: the entries.
        repeat: the list of bad runs.
        not_needed: how many other runs the campaign could have had.
        decisions: what is decided about configurations, for people.
    """
    ids = {kind: [item["id"] for item in index if item["verdict"] is kind] for kind in Verdict}
    failed, failed_cut = id_ranges(ids[Verdict.FAILED], SUMMARY_LIMIT)
    errored, errored_cut = id_ranges(ids[Verdict.ERRORED], SUMMARY_LIMIT)
    bad = (item for item in index if item["verdict"] is not Verdict.PASSED)
    return Summary(
        total=len(index) + not_needed,
        passed=len(ids[Verdict.PASSED]),
        failed=len(ids[Verdict.FAILED]),
        errored=len(ids[Verdict.ERRORED]),
        not_needed=not_needed or None,
        decisions=decisions[:DECISIONS_LIMIT] or None,
        stored=sum(item["attempt"] > 0 for item in index),
        failed_runs=failed,
        errored_runs=errored,
        truncated=failed_cut or errored_cut,
        failing=tuple(f"{item['variant']}/{item['run']}" for item in islice(bad, FAILING_LIMIT)),
        repeat=repeat,
    )

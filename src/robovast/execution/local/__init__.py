"""Executing a campaign on this machine: in Docker, in Podman or as plain processes."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from robovast.base.atomic import sync_folder, sync_tree, write_atomically
from robovast.base.errors import InputError
from robovast.base.serialization import dump_yaml
from robovast.base.yaml_files import read_mapping
from robovast.campaign.configurations import (
    document_path,
    read_configurations,
    variants_in,
    with_stored_files,
)
from robovast.campaign.decisions import DECIDE, test_record
from robovast.campaign.layout import Layout
from robovast.campaign.planned_runs import PlannedRuns, planned_runs
from robovast.execution.generate import write_configurations, write_execution
from robovast.execution.local.campaign import execute_campaign, execute_planned, executing
from robovast.execution.local.choose import choose_runtime, trusted_code
from robovast.execution.local.continuing import continued_session
from robovast.execution.local.edited_inputs import record_inputs
from robovast.execution.local.events import ExecutionObserver, ExecutionSummary, LocalOptions
from robovast.execution.local.limits import check_limits
from robovast.execution.local.prepare import open_shell, prepare_run
from robovast.execution.local.replay import replay_run
from robovast.execution.local.session import Session
from robovast.execution.local.store import make_campaign_folder, refuse_bytes, storage_errors
from robovast.execution.local.variants import campaign_seed, choose_variants
from robovast.model.document import Document, load_document
from robovast.model.expansion import select_any
from robovast.model.packs import PlanSpec
from robovast.model.plan import plan_runs, plan_variants

__all__ = [
    "ExecutionObserver",
    "ExecutionSummary",
    "LocalOptions",
    "open_shell",
    "prepare_run",
    "replay_run",
    "resume_campaign",
    "run_campaign",
]


def run_campaign(
    document: Document, output: Path, options: LocalOptions, observer: ExecutionObserver
) -> ExecutionSummary:
    """Execute a new campaign in a new subfolder of `output`.

    Raises:
        InputError: the document cannot be expanded, limits containers to what is no amount, or no
            variant matches `options.select`.
        CannotRunError: the runtime is not usable; nothing was started or created.
        StorageError: `output` cannot be written.
    """
    check_limits(document)
    with TemporaryDirectory(prefix="robovast-") as scratch:
        composition = choose_variants(document, Path(scratch), options, observer.message)
        runs = options.runs or document.vast.execution.most_runs
        test = document.vast.execution.test(runs)
        plan = plan_variants(composition.variants, runs, document.vast.execution.runs_per_start)
        runtime = choose_runtime(document, options, observer.message)
        identity = runtime.check()
        started, seed = datetime.now().astimezone(), campaign_seed(document)
        layout = make_campaign_folder(output, document.vast.campaign_name, started)
        with storage_errors(layout.root):
            write_configurations(document, composition, layout.root, timings=True)
            write_execution(
                layout,
                document,
                started=started,
                runs=runs,
                seed=seed,
                kind="local",
                image=identity.image,
                image_revision=identity.digest,
                test=test,
            )
            record_inputs(document, layout)
            sync_tree(layout.root)
            sync_folder(output)
    variants = [with_stored_files(layout, variant) for variant in composition.variants]
    session = Session(document, layout, options, runtime, identity)
    return execute_campaign(session, plan, plan_runs(plan, variants, seed), observer, test)


def resume_campaign(
    campaign: Path, options: LocalOptions, observer: ExecutionObserver
) -> ExecutionSummary:
    """Execute the remaining runs of a campaign; runs with a finished record are not repeated.

    Raises:
        InputError: the folder is not a campaign.
        CannotRunError: the runtime is not usable, or the environment of plain processes is gone.
        StorageError: results cannot be written, or another program executes the campaign.
    """
    refuse_bytes(campaign)
    layout = Layout(campaign.absolute())
    data = read_configurations(layout)
    with trusted_code(layout.root, options):
        document = load_document(document_path(layout, data))
    variants = variants_in(layout, data)
    chosen = {variant.name for variant in select_any(variants, options.select)}
    seed, execution, wanted = recorded_seed(layout), document.vast.execution, options.runs or 0

    def planned() -> tuple[PlannedRuns, PlanSpec]:
        before = recorded_runs(layout, options.runs)
        each = before.raised(wanted, None if len(chosen) == len(variants) else chosen)
        return each, plan_variants(variants, each.each, execution.runs_per_start, each.more)

    planned()  # refuses what cannot be planned, before anything is prepared
    session = continued_session(document, layout, options, observer)
    with executing(session, observer) as observer:
        each, plan = planned()  # another program may have planned more since
        test = execution.test(max(map(each.of, chosen)))
        if each != recorded_runs(layout, options.runs):
            # fewer runs than the document's may have lowered those that the test needs at least
            rule = {DECIDE: test_record(test)} if test is not None else {}
            record_again(layout, {**each.record(), **rule})
        runs = [
            run
            for run in plan_runs(plan, variants, seed)
            if run.variant.name in chosen and not 0 < wanted <= run.number
        ]
        return execute_planned(session, plan, runs, observer, test)


def record_again(layout: Layout, changes: Mapping[str, Any]) -> None:
    """Change the record of how a campaign is executed.

    Raises:
        StorageError: it cannot be written.
    """
    record = read_mapping(layout.execution_record)
    with storage_errors(layout.root):
        write_atomically(layout.execution_record, dump_yaml({**record, **changes}))


def recorded_runs(layout: Layout, given: int | None = None) -> PlannedRuns:
    """The runs of each variant that were planned; `given` ones where that is not recorded.

    Raises:
        InputError: it is neither recorded nor given.
    """
    path = layout.execution_record
    with suppress(InputError):
        found = planned_runs(read_mapping(path))
        if found.each:
            return found
    if given is None:
        raise InputError(
            f"{path}: does not contain the number of planned runs", hint="set `--runs`"
        )
    return PlannedRuns(given)


def recorded_seed(layout: Layout) -> int | None:
    """The seed that a campaign began with; None when RoboVAST 1.x began it."""
    record = read_mapping(layout.execution_record)
    if "replay_of" in record:
        raise InputError(
            f"{layout.root} is a replay of {record['replay_of']}, which cannot be continued",
            hint="start another one with `vast replay`",
        )
    if "minimise_of" in record:
        raise InputError(
            f"{layout.root} reduces {record['minimise_of']}",
            hint="continue it with `vast minimise --resume`",
        )
    found = record.get("seed")
    if found is None or type(found) is int:
        return found
    raise InputError(
        f"{layout.execution_record}: `seed` must be a whole number, not {found!r}.",
        hint="restore the file",
    )

"""Executing a campaign on this machine: in Docker, in Podman or as plain processes."""

from __future__ import annotations

import dataclasses
import errno
import os
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime, timedelta
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

from robovast.base.atomic import make_folder, sync_folder, sync_tree
from robovast.base.errors import InputError, StorageError
from robovast.base.file_errors import cause, refuse_obstacle
from robovast.base.yaml_files import read_mapping
from robovast.campaign.configurations import read_variants
from robovast.campaign.layout import Layout
from robovast.execution.generate import write_configurations, write_execution
from robovast.execution.local.campaign import execute_campaign
from robovast.execution.local.choose import choose_runtime
from robovast.execution.local.events import LocalOptions, Observer, Summary
from robovast.execution.local.prepare import open_shell, prepare_run
from robovast.execution.local.session import Session
from robovast.execution.local.store import explained
from robovast.execution.local.variants import campaign_seed, choose_variants
from robovast.model.document import Document, load_document
from robovast.model.expansion import Variant, select_variants
from robovast.model.naming import campaign_folder_name
from robovast.model.plan import plan_runs, plan_variants

__all__ = [
    "LocalOptions",
    "Observer",
    "Summary",
    "open_shell",
    "prepare_run",
    "resume_campaign",
    "run_campaign",
]


def run_campaign(
    document: Document, output: Path, options: LocalOptions, observer: Observer
) -> Summary:
    """Execute a new campaign in a new subfolder of `output`.

    Raises:
        InputError: the document cannot be expanded, or no variant matches `options.select`.
        CannotRunError: the runtime is not usable; nothing was started or created.
        StorageError: `output` cannot be written.
    """
    with TemporaryDirectory(prefix="robovast-") as scratch:
        composition = choose_variants(document, Path(scratch), options, observer.message)
        runs = options.runs or document.vast.execution.runs
        plan = plan_variants(composition.variants, runs, document.vast.execution.runs_per_job)
        runtime = choose_runtime(document, options, observer.message)
        identity = runtime.check()
        started, seed = datetime.now().astimezone(), campaign_seed(document)
        layout = make_campaign_folder(output, document.vast.campaign_name, started)
        with explained(layout.root):
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
            )
            sync_tree(layout.root)
            sync_folder(output)
    variants = _stored_files(layout, composition.variants)
    session = Session(document, layout, options, runtime, identity)
    return execute_campaign(session, plan, plan_runs(plan, variants, seed), observer)


def resume_campaign(campaign: Path, options: LocalOptions, observer: Observer) -> Summary:
    """Execute the remaining runs of a campaign; runs with a finished record are not repeated.

    Raises:
        InputError: the folder is not a campaign.
        CannotRunError: the runtime is not usable.
        StorageError: results cannot be written, or another program executes the campaign.
    """
    _refuse_bytes(campaign)
    layout = Layout(campaign.absolute())
    name, variants = read_variants(layout)
    document = load_document(layout.config / name)
    repeated = options.runs or planned_runs(layout)
    plan = plan_variants(variants, repeated, document.vast.execution.runs_per_job)
    runs = plan_runs(plan, variants, recorded_seed(layout))
    if options.select is not None:
        chosen = {variant.name for variant in select_variants(variants, options.select)}
        runs = [run for run in runs if run.variant.name in chosen]
    runtime = choose_runtime(document, options, observer.message)
    session = Session(document, layout, options, runtime, runtime.check())
    return execute_campaign(session, plan, runs, observer)


def make_campaign_folder(output: Path, name: str, started: datetime) -> Layout:
    """Create a campaign's folder, named after the first second that is not taken yet."""
    refuse_obstacle(output)
    _refuse_bytes(output)
    try:
        make_folder(output)
        for seconds in count():
            root = output.absolute() / campaign_folder_name(name, started + timedelta(0, seconds))
            with suppress(FileExistsError):
                root.mkdir()
                break
    except OSError as error:
        why = "no folder can be made in it" if error.errno == errno.ENOENT else cause(error)
        raise StorageError(
            f"{output}: results cannot be written there: {why}. Choose another folder."
        ) from None
    if not os.access(root, os.W_OK):
        raise StorageError(f"{root}: cannot be written.")
    return Layout(root)


def _refuse_bytes(folder: Path) -> None:
    """Raise a StorageError for a path that is not text: containers and records must name it."""
    try:
        str(folder.absolute()).encode()
    except UnicodeEncodeError:
        raise StorageError(
            f"{folder.absolute()}: the path is not text in UTF-8. Choose or rename a folder."
        ) from None


def _stored_files(layout: Layout, variants: Sequence[Variant]) -> list[Variant]:
    """Variants whose files are the campaign's copies, since generated files no longer exist."""
    return [
        dataclasses.replace(
            variant,
            files=tuple(
                dataclasses.replace(file, source=layout.variant_config(variant.name) / file.name)
                for file in variant.files
            ),
        )
        for variant in variants
    ]


def planned_runs(layout: Layout) -> int:
    """The runs of each variant that were planned.

    Raises:
        InputError: it is not recorded.
    """
    path = layout.execution_record
    try:
        return int(read_mapping(path)["runs"])
    except (InputError, ValueError, TypeError, KeyError):
        raise InputError(
            f"{path}: does not say how many runs were planned; give `--runs`."
        ) from None


def recorded_seed(layout: Layout) -> int | None:
    """The seed that a campaign began with; None when an older version began it."""
    found = read_mapping(layout.execution_record).get("seed")
    if found is None or type(found) is int:
        return found
    raise InputError(f"{layout.execution_record}: `seed` must be a whole number, not {found!r}.")

"""Executes a stored run again: with its files, parameters, seed and image, in a new folder."""

from __future__ import annotations

import dataclasses
import glob
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any

from robovast.base.atomic import sync_folder, sync_tree
from robovast.base.containers import ENGINES, check_engine, fetch_image
from robovast.base.errors import InputError
from robovast.base.sequential import SequentialTest
from robovast.base.serialization import dump_yaml
from robovast.base.version import __version__
from robovast.base.yaml_files import read_mapping
from robovast.campaign.configurations import document_path, variant_of
from robovast.campaign.imported import is_imported, mark_imported
from robovast.campaign.layout import RUN_RECORD, Layout
from robovast.campaign.run_record import RunRecord, read_run_record
from robovast.execution.generate import write_execution
from robovast.execution.local.campaign import execute_campaign
from robovast.execution.local.choose import CONTAINER, choose_runtime, trusted_code
from robovast.execution.local.events import ExecutionObserver, ExecutionSummary, LocalOptions
from robovast.execution.local.process_environment import environment_as_then
from robovast.execution.local.runtime import Runtime, RuntimeIdentity
from robovast.execution.local.session import Session
from robovast.execution.local.store import make_campaign_folder, storage_errors
from robovast.execution.local.stored_inputs import check_inputs, copy_inputs, read_inputs
from robovast.model.document import Document, load_document
from robovast.model.expansion import Variant
from robovast.model.naming import is_run_number
from robovast.model.packs import Block, PlanSpec
from robovast.model.plan import plan_runs

OWN_RUNTIME = "same"
"""The runtime that executed the run."""


@dataclass(frozen=True)
class ExecutedRun:
    """A run that was executed, and the campaign's files about it."""

    layout: Layout
    variant: Variant
    record: RunRecord
    number: int
    """Name of its folder: a merged campaign has given it another than its record says."""
    configurations: Mapping[str, Any]
    """`configurations.yaml` of the campaign, with this run's variant alone."""

    @property
    def path(self) -> str:
        """`<variant>/<number>`."""
        return f"{self.variant.name}/{self.number}"

    @property
    def full_path(self) -> str:
        """`<campaign>/<variant>/<number>`."""
        return f"{self.record.campaign}/{self.path}"

    @property
    def folder(self) -> Path:
        """What it left."""
        return self.layout.run(self.path)

    @cached_property
    def image(self) -> str:
        """The image that ran, by its digest where that is known."""
        return self.record.image_digest or self.record.image


def find_run(folder: Path) -> ExecutedRun:
    """The run in a folder `<campaign>/<variant>/<run>`.

    Raises:
        InputError: there is no run with a result, or files of its campaign are missing.
    """
    folder = Path(os.path.realpath(folder))  # `..` leads out of the run's folder, not of a link
    record = read_run_record(folder)
    if record is None or not is_run_number(folder.name):
        raise _no_run(folder)
    if not record.finished:
        raise InputError(
            f"{folder}: was interrupted, so that there is nothing to compare with.",
            hint="name a run with a verdict",
        )
    layout, name = Layout(folder.parent.parent), folder.parent.name
    data = read_inputs(layout, name)
    check_inputs(folder, data)
    return ExecutedRun(
        layout, variant_of(layout, data["configs"][0]), record, int(folder.name), data
    )


def _no_run(folder: Path) -> InputError:
    """Return the error about a folder that is not the folder of a run."""
    hint = "name the folder of a run, `<campaign>/<configuration>/<run>`"
    if not os.path.exists(folder):
        return InputError(f"{folder}: there is no such folder", hint=hint)
    found = (glob.glob(f"{up}/{RUN_RECORD}", root_dir=folder) for up in ("*", "*/*"))
    runs = sorted((folder / name).parent for name in chain(*found))
    if runs:
        hint += f", such as {runs[0]}"
        return InputError(f"{folder}: is not the folder of one run", hint=hint)
    return InputError(f"{folder}: there is no run with a `{RUN_RECORD}` of this version", hint=hint)


@dataclass(frozen=True)
class Again:
    """A run that is executed again, and what executes it."""

    run: ExecutedRun
    document: Document
    options: LocalOptions
    runtime: Runtime
    identity: RuntimeIdentity

    def session(self, layout: Layout) -> Session:
        """Of a campaign's folder with a copy of the run's inputs."""
        with trusted_code(layout.root, self.options):
            copied = load_document(layout.config / self.document.path.name)
        return Session(copied, layout, self.options, self.runtime, self.identity)


def execute_again(run: ExecutedRun, options: LocalOptions, tell: Callable[[str], None]) -> Again:
    """What executes a run again: runtime and image as then, unless others are chosen.

    Raises:
        InputError: the campaign's document cannot be read.
        CannotRunError: the runtime is not usable, or the image is gone.
    """
    with trusted_code(run.layout.root, options):
        document = load_document(document_path(run.layout, run.configurations))
    options = _as_then(run, options)
    runtime = choose_runtime(document, options, tell)
    return Again(run, document, options, runtime, _check(run, options, runtime, tell))


def begin_campaign(
    again: Again, output: Path, kind: str, runs: int, test: SequentialTest | None = None
) -> Session:
    """Make a campaign's folder below `output` with the inputs of a run.

    Args:
        again: the run.
        output: folder for the campaign's folder.
        kind: what it is for; a part of its name, and its record has the key `<kind>_of`.
        runs: that are planned.
        test: when they are enough.

    Raises:
        InputError: `output` is in the run's own campaign.
        StorageError: `output` cannot be written.
    """
    run, document = again.run, again.document
    _refuse_inside(output, run.layout.root)
    started = datetime.now().astimezone()
    layout = make_campaign_folder(output, f"{document.vast.campaign_name}-{kind}", started)
    with storage_errors(layout.root):
        copy_inputs(run.layout, run.variant.name, layout)
        if is_imported(run.layout.root):
            mark_imported(layout.root)
        layout.transient.mkdir(exist_ok=True)
        layout.configurations.write_text(dump_yaml(run.configurations), encoding="utf-8")
        write_execution(
            layout,
            document,
            started=started,
            runs=runs,
            seed=None,
            kind="local",
            image=again.identity.image,
            image_revision=again.identity.digest,
            test=test,
            again=(f"{kind}_of", run.full_path),
        )
        sync_tree(layout.root)
        sync_folder(output)
    return again.session(layout)


def replay_run(
    run: ExecutedRun, output: Path, times: int, options: LocalOptions, observer: ExecutionObserver
) -> ExecutionSummary:
    """Execute a run again, in a new campaign's folder below `output`; the run stays as it is.

    Raises:
        InputError: the campaign's document cannot be read.
        CannotRunError: the runtime is not usable, or the image is gone.
        StorageError: `output` cannot be written.
    """
    again = execute_again(run, options, observer.message)
    session = begin_campaign(again, output, "replay", times)
    block = Block(first_variant=0, variants=1, first_run=run.number, runs=times)
    plan = PlanSpec(blocks=(block,))
    variant = variant_of(session.layout, run.configurations["configs"][0])
    runs = [dataclasses.replace(r, seed=run.record.seed) for r in plan_runs(plan, [variant])]
    return execute_campaign(session, plan, runs, observer)


def _refuse_inside(output: Path, campaign: Path) -> None:
    """Refuse a place for replays where they would change the campaign that is replayed."""
    if Path(os.path.realpath(output)).is_relative_to(os.path.realpath(campaign)):
        raise InputError(
            f"{output}: is in the campaign {campaign}, which a replay leaves as it is",
            hint="name a folder outside of it: `--out PATH`",
        )


def _as_then(run: ExecutedRun, options: LocalOptions) -> LocalOptions:
    """The options, with runtime and image of the run unless others are chosen.

    The record of a campaign that was imported does not choose plain processes.
    """
    known = {*ENGINES, "process"}
    own = run.record.runtime if run.record.runtime in known else "auto"
    runtime = own if options.runtime == OWN_RUNTIME else options.runtime
    imported = is_imported(run.layout.root)
    if imported and options.runtime != "process" and runtime not in ENGINES:
        runtime = CONTAINER
    in_container = run.record.runtime != "process"
    image = options.image or (run.image if in_container else None)
    then = dataclasses.replace(options, runtime=runtime, image=image)
    if in_container or options.runtime != OWN_RUNTIME or imported:
        return then
    environment = environment_as_then(run.record.image, str(run.folder), "replay the run")
    return dataclasses.replace(then, process_environment=environment)


def _check(
    run: ExecutedRun, options: LocalOptions, runtime: Runtime, message: Callable[[str], None]
) -> RuntimeIdentity:
    """Check the runtime, and say what is not as it was."""
    record = run.record
    executed = read_mapping(run.layout.execution_record).get("robovast_version")
    if runtime.name in ENGINES and options.image is not None:
        check_engine(runtime.name, "replay it elsewhere")
        tag = f"replay it with the current image of this name: `--image {record.image}`"
        fetch_image(runtime.name, options.image, message, tag)
        if options.image == record.image != run.image:
            message(f"Runs with the current {options.image}. The stored run used {run.image}.")
        elif not record.image_digest and options.image == record.image:
            message(f"The digest of {record.image} was not recorded, so the image may differ.")
    identity = runtime.check()
    if runtime.name != record.runtime:
        message(f"Runs with {runtime.name}. The stored run used {record.runtime}.")
    elif runtime.name == "process" and identity.image != record.image:
        message(f"Runs in the environment {identity.image}. The stored run used {record.image}.")
    if executed not in {None, __version__}:
        message(f"Runs with RoboVAST {__version__}. The stored run used {executed}.")
    if record.seed is None:
        message("No seed was recorded, so chance can cause differences.")
    return identity

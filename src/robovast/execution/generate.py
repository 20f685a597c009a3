"""Generates parts of a campaign: copies of inputs, resolved parameters, the run contract."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from robovast.base import safe_paths
from robovast.base.atomic import appearing_file, part_name, put_in_place, sync_tree
from robovast.base.errors import StorageError
from robovast.base.sequential import SequentialTest
from robovast.base.serialization import dump_yaml, to_plain
from robovast.base.version import __version__
from robovast.campaign.configurations import configuration_record
from robovast.campaign.decisions import DECIDE, test_record
from robovast.campaign.layout import SCENARIO_CONFIG, VARIANT_RECORD, Layout
from robovast.campaign.planned_runs import PlannedRuns
from robovast.execution.contract import contract_files
from robovast.model.document import Document
from robovast.model.expansion import Composition, Variant
from robovast.model.identity import Identities
from robovast.model.inputs import campaign_files, container_files
from robovast.model.naming import CONFIG
from robovast.model.scenario import read_scenario


def write_configurations(
    document: Document,
    composition: Composition,
    output: Path,
    *,
    timings: bool,
    earlier: Sequence[Variant] = (),
    lasting: bool = False,
    tell: Callable[[str], None] = lambda _: None,
) -> None:
    """Write `_config`, `_transient` and every `<variant>/_config` of a campaign.

    Inputs that the campaign has already stay as they are, even if the document's have changed.

    Args:
        document: the checked document.
        composition: its expansion, or a selected part of it.
        output: the campaign's folder; created if missing.
        timings: also record when each variation was applied and how long it took; without timings,
            equal input produces equal bytes.
        earlier: variants that were written before; they come first in the list.
        lasting: sync the files of variants to the disk before the list names them.
        tell: receives occasional progress messages.
    """
    layout = Layout(output)
    for folder in (layout.config, layout.transient):
        folder.mkdir(parents=True, exist_ok=True)
    if document.folder != layout.config:  # otherwise it is the campaign's own copy
        for path in campaign_files(document, composition):
            if not (layout.config / path).exists():  # runs may have begun with what is there
                _copy_whole(document.folder / path, layout.config / path)
    for file in composition.transient_files:
        _copy_whole(file.source, layout.transient / file.name)
    for script in contract_files():
        _copy_whole(script, layout.transient / script.name)
    scenario = read_scenario(document.scenario).name
    identities = Identities(document)
    for number, variant in enumerate(composition.variants):
        if number % 100 == 0:
            tell(variant.name)
        _write_variant(layout, variant, scenario, identities.of(variant))
        if lasting:
            sync_tree(layout.variant(variant.name))
    variants = (*earlier, *composition.variants)
    with (
        appearing_file(layout.configurations) as part,
        part.open("w", encoding="utf-8") as record,
    ):
        record.writelines(_configurations(document, variants, timings=timings))


def write_execution(
    layout: Layout,
    document: Document,
    *,
    started: datetime,
    runs: int,
    seed: int | None,
    kind: str,
    image: str,
    image_revision: str,
    added: bool = False,
    test: SequentialTest | None = None,
    again: tuple[str, str] | None = None,
) -> None:
    """Write `_execution/execution.yaml`: when, with what and how the campaign is executed.

    Args:
        layout: of the campaign.
        document: of the campaign.
        started: when it began.
        runs: of each variant.
        seed: of the campaign, if its runs have seeds of it.
        kind: who executes it.
        image: what executes its runs.
        image_revision: digest of the image.
        added: whether runs were added since it began.
        test: when the runs of a variant are enough.
        again: a key, and the run of another campaign that is executed again.
    """
    layout.execution.mkdir(exist_ok=True)
    record = {
        "execution_time": started.astimezone(UTC).isoformat(timespec="seconds"),
        "robovast_version": __version__,
        **PlannedRuns(runs, added=added).record(),
        "seed": seed,
        "execution_type": kind,
        "image": image,
        "image_revision": image_revision,
        "cluster_info": None,
        "env": document.vast.execution.env,
    }
    if test is not None:
        record[DECIDE] = test_record(test)
    if again is not None:
        record.update([again])
    layout.execution_record.write_text(dump_yaml(record), encoding="utf-8")


def copy_file(source: Path, target: Path) -> None:
    """Copy a file with its mode; create missing folders."""
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy2(source, target)


def _copy_whole(source: Path, target: Path) -> None:
    """Copy a file; after a kill, all of it is there, or nothing."""
    part = part_name(target)
    copy_file(source, part)
    put_in_place(part, target, lasting=False)


def _write_variant(layout: Layout, variant: Variant, scenario: str, identity: Any) -> None:
    own = str(layout.variant(variant.name))  # there may be very many: no Path for each
    config = f"{own}/{CONFIG}"
    for path in (own, config):
        with contextlib.suppress(FileExistsError):
            os.mkdir(path)
        if os.path.islink(path):
            raise StorageError(
                f"{path}: is a link, and nothing is written through links.", hint="remove the link"
            )
    factors = {"factors": dict(variant.factors)} if variant.factors else {}
    _write_text(f"{own}/{VARIANT_RECORD}", dump_yaml({**identity, **factors}))
    _write_text(f"{own}/{SCENARIO_CONFIG}", dump_yaml({scenario: dict(variant.parameters)}))
    for file in variant.files:
        safe_paths.copy_file(file.source.resolve(), Path(config, file.name), Path(config))


def _write_text(path: str, text: str) -> None:
    """Write a small file with as few system calls as possible."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC
    descriptor = os.open(path, flags, 0o666)
    with open(descriptor, "wb", buffering=0) as file:
        file.write(text.encode())


def _configurations(
    document: Document, variants: Sequence[Variant], *, timings: bool
) -> Iterator[str]:
    """The text of `configurations.yaml`, variant by variant: there may be very many."""
    yield dump_yaml(
        {
            "vast": document.path.name,
            "metadata": to_plain(document.vast.metadata),
            "scenario_file": document.vast.scenario_file,
        }
    )
    yield "configs:\n" if variants else "configs: []\n"
    for variant in variants:
        yield dump_yaml([configuration_record(variant, timings=timings)])
    yield dump_yaml(
        {
            "_run_files": [str(path) for path in container_files(document)],
            "_input_files": [document.path.name, str(document.vast.scenario_file)],
        }
    )

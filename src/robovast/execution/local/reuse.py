"""Takes over runs that another campaign of the same folder has executed with the same key."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from robovast.base import safe_paths
from robovast.base.locks import is_locked
from robovast.campaign.checksums import DifferentError, copy_files, copy_verified
from robovast.campaign.imported import is_imported
from robovast.campaign.layout import RUNNING, TEST_RESULT, Layout, job_folder, parameters_key
from robovast.campaign.records import copied_record
from robovast.campaign.run_record import RunRecord, read_run_record
from robovast.campaign.verdict import Verdict, read_test_result
from robovast.execution.job_config import parameter_documents
from robovast.execution.local.events import ExecutionObserver
from robovast.execution.local.session import Session
from robovast.execution.local.store import put_run_in_place, storage_errors
from robovast.model.naming import holds_campaign
from robovast.model.packs import PlanSpec
from robovast.model.plan import PackStart, Run, pack_runs

_STAGE = "reused"
"""Folder below `.running` where a pack is copied before it appears in the results."""
_RESULTS = (Verdict.PASSED, Verdict.FAILED)


def reused_runs(
    session: Session,
    plan: PlanSpec,
    runs: Sequence[Run],
    first_job: int,
    observer: ExecutionObserver,
) -> dict[int, RunRecord]:
    """Take over those of the runs that are stored elsewhere, if the user wants it.

    A pack is taken over as a whole, or not at all: its runs are executed by one process. Its
    number is `first_job` or a later one.

    Returns:
        Their records, by id.
    """
    if not session.options.reuse or not runs or why_nothing(session):
        return {}
    with storage_errors(session.layout.root):
        source = _Source(session.layout.root)
        found: dict[int, RunRecord] = {}
        for pack in pack_runs(plan, runs, first_job):
            for run, record in _take_over(session, pack, source):
                found[run.id] = record
                observer.run_finished(run, record)
    for line in source.messages(len(found), len(runs)):
        observer.message(line)
    return found


def why_nothing(session: Session) -> str:
    """Why no run can be reused; empty if some may be."""
    execution = session.document.vast.execution
    if execution.seed is None:
        return (
            f"{session.document.path.name} sets no `execution.seed`, so each campaign draws other "
            "seeds. Set one, such as `seed: 1`."
        )
    if not session.conditions:
        return (
            f"the contents of {session.identity.image} are unknown. An image needs a digest (pull "
            "it, or push it once); local processes need the default environment."
        )
    return ""


@dataclass
class _Source:
    """The other campaigns in a results folder, and why runs of them were not taken."""

    own: Path
    refusals: Counter[str] = field(default_factory=Counter)
    examples: dict[str, str] = field(default_factory=dict)
    """The first run of each refusal."""

    def __post_init__(self) -> None:
        names = sorted(os.listdir(self.own.parent), key=lambda n: (n[-17:], n), reverse=True)
        self._campaigns = list(self._usable(names))

    def packs(
        self, pack: PackStart, keys: dict[int, str]
    ) -> Iterator[list[tuple[Path, RunRecord]]]:
        """The folders and records of runs that equal those of a pack, the newest first."""
        for campaign in self._campaigns:
            found = []
            for run in pack.runs:
                record = self._find(campaign / run.path, keys[run.id])
                if record is None:
                    break
                found.append((campaign / run.path, record))
            else:
                yield found

    def refuse(self, why: str, example: Path) -> None:
        """Remember why a run was not taken."""
        self.refusals[why] += 1
        self.examples.setdefault(why, example.relative_to(self.own.parent).as_posix())

    def messages(self, reused: int, asked: int) -> Iterator[str]:
        """What the user should know."""
        yield f"Reused {reused} of {asked} runs."
        for why, count in self.refusals.items():
            more = f" and {count - 1} more" if count > 1 else ""
            yield f"Not reused: {self.examples[why]}{more}: {why}."

    def _usable(self, names: Sequence[str]) -> Iterator[Path]:
        for name in names:
            folder = self.own.parent / name
            if name.startswith(".") or folder == self.own or not holds_campaign(folder):
                continue
            if is_imported(folder):
                self.refuse("the campaign was imported", folder)
            elif is_locked(folder / RUNNING):
                self.refuse("the campaign is running", folder)
            else:
                yield folder

    def _find(self, folder: Path, key: str) -> RunRecord | None:
        """The record of a stored run, if the run has a result and this key."""
        record = read_run_record(folder)
        if record is None:
            if os.path.lexists(folder):
                self.refuse("its run.json is missing or damaged", folder)
            return None
        if not record.key:
            self.refuse("it has no key (it was run by RoboVAST 1.x or on a cluster)", folder)
        if record.key != key:
            return None
        why = _why_not(record)
        if why:
            self.refuse(why, folder)
        return None if why else record


def _why_not(record: RunRecord) -> str:
    if record.verdict not in _RESULTS:
        return f"it is {record.verdict}, not passed or failed"
    if record.outputs is None:
        return "it has no checksums (links, or too many files, are among its output)"
    return ""


def _take_over(
    session: Session, pack: PackStart, source: _Source
) -> Sequence[tuple[Run, RunRecord]]:
    """Take over all runs of a pack from the first campaign that has them unchanged."""
    stage = session.layout.running / _STAGE
    for found in source.packs(pack, session.keys(pack)):
        with suppress(DifferentError):
            _stage(stage, found, source)
            return _store(session, pack, found, stage)
    return ()


def _stage(stage: Path, found: Sequence[tuple[Path, RunRecord]], source: _Source) -> None:
    """Copy the files of runs.

    Raises:
        DifferentError: some are not what they were, or not what the record says.
    """
    safe_paths.remove(stage, stage.parent)
    for number, (folder, record) in enumerate(found):
        copy = stage / str(number)
        copy.mkdir(parents=True)
        try:
            copy_verified(folder, copy, record.outputs or {})
            verdict = read_test_result(copy).verdict
            if verdict is not record.verdict:  # somebody has edited the one or the other
                raise DifferentError(f"it is {record.verdict}, but {verdict} by its {TEST_RESULT}")
        except DifferentError as error:
            source.refuse(str(error), folder)
            raise


def _store(
    session: Session, pack: PackStart, found: Sequence[tuple[Path, RunRecord]], stage: Path
) -> list[tuple[Run, RunRecord]]:
    """Complete a pack that was copied, and move its runs into the results."""
    layout = session.layout
    _copy_job(found[0][0], layout, pack.name)
    parameters = parameter_documents(pack, session.scenario)
    (layout.root / parameters_key(pack.name)).write_text(parameters, encoding="utf-8")
    records = []
    for number, (run, (folder, record)) in enumerate(zip(pack.runs, found, strict=True)):
        executed = f"{folder.parent.parent.name}/{run.path}"
        new = copied_record(record, executed, run, layout.root.name, pack.name)
        put_run_in_place(layout, stage / str(number), new)
        records.append((run, new))
    return records


def _copy_job(run: Path, layout: Layout, name: str) -> None:
    """Copy the output of the job that executed a run."""
    folder = job_folder(run)
    layout.job(name).mkdir(parents=True)
    if folder is not None:
        copy_files(folder, run.parent.parent, layout.job(name))

"""Stores finished runs: a run appears in the results complete or not at all."""

from __future__ import annotations

import errno
import os
import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import datetime, timedelta
from itertools import count
from pathlib import Path

from robovast.base.atomic import make_folder, put_in_place
from robovast.base.errors import StorageError
from robovast.base.file_errors import cause, refuse_obstacle
from robovast.base.task_record import report
from robovast.campaign.checksums import checksums
from robovast.campaign.layout import JOB_LINK, Layout, job_link_target
from robovast.campaign.records import Circumstances, EndedRun, make_record
from robovast.campaign.reserved_names import set_own_names_aside
from robovast.campaign.run_record import RunRecord, read_run_record
from robovast.execution.local.session import Session
from robovast.execution.local.stored_inputs import check_plain
from robovast.model.naming import campaign_folder_name, is_run_number
from robovast.model.plan import Run

_NAMED = 3
"""Most runs that a message names."""


def make_campaign_folder(output: Path, name: str, started: datetime) -> Layout:
    """Create a campaign's folder, named after the first second that is not taken yet.

    Raises:
        StorageError: it cannot be created.
    """
    refuse_obstacle(output)
    refuse_bytes(output)
    try:
        make_folder(output)
        for seconds in count():
            root = output.absolute() / campaign_folder_name(name, started + timedelta(0, seconds))
            with suppress(FileExistsError):
                root.mkdir()
                break
    except OSError as error:
        why = "no folder can be created in it" if error.errno == errno.ENOENT else cause(error)
        raise StorageError(
            f"{output}: results cannot be written there: {why}", hint="choose another folder"
        ) from None
    if not os.access(root, os.W_OK):
        raise StorageError(f"{root}: cannot be written.", hint="choose another folder")
    report(campaign=root.name)
    return Layout(root)


def refuse_bytes(folder: Path) -> None:
    """Raise a StorageError for a path that is not text: containers and records must name it."""
    try:
        str(folder.absolute()).encode()
    except UnicodeEncodeError:
        raise StorageError(
            f"{folder.absolute()}: the path is not text in UTF-8", hint="choose or rename a folder"
        ) from None


def store_run(session: Session, ended: EndedRun, key: str) -> RunRecord:
    """Complete a run's folder with its record and move it into the results.

    Args:
        session: of the campaign.
        ended: the run.
        key: of what it depended on.
    """
    folder, job = ended.folder, ended.job.name
    target = session.layout.run(ended.run.path)
    earlier = read_run_record(target)
    folder.mkdir(parents=True, exist_ok=True)
    set_own_names_aside(folder)
    circumstances = Circumstances(
        campaign=session.layout.root.name,
        attempt=earlier.attempt + 1 if earlier else 1,
        job=job,
        runtime=session.runtime.name,
        image=session.identity.image,
        image_digest=session.identity.digest,
        host=session.host,
        key=key,
        outputs=checksums(folder),
    )
    record = make_record(ended, circumstances)
    put_run_in_place(session.layout, folder, record)
    return record


def put_run_in_place(layout: Layout, folder: Path, record: RunRecord) -> None:
    """Move a run's folder into the results, with its record and the link to its job."""
    target = layout.run(f"{record.variant}/{record.run}")
    earlier = read_run_record(target)
    (folder / JOB_LINK).symlink_to(job_link_target(record.job))
    record.write(folder)
    put_in_place(folder, target, replace=earlier is not None and not earlier.finished)


def finished_runs(
    session: Session, runs: Sequence[Run], tell: Callable[[str], None]
) -> dict[int, RunRecord]:
    """Records of the runs that need not be executed again, by id.

    Unknown content in a run's place (a record of a newer version, an empty record after a power
    cut, that of another run, a folder without record) is moved aside, since it may be all that is
    left of a run.

    Raises:
        InputError: an input of a configuration is a link.
        StorageError: a configuration's folder is a link, which leads to other results.
    """
    _refuse_links(session.layout, runs)
    found: dict[int, RunRecord] = {}
    aside = []
    for run in runs:
        place = session.layout.run(run.path)
        record = read_run_record(place)
        if record is not None and f"{record.variant}/{record.run}" != run.path:
            record = None
        if record is None and os.path.lexists(place):
            aside.append(run.path)
            _set_aside(session.layout, run)
        elif record is not None and record.finished:
            found[run.id] = record
    if aside:
        listed = ", ".join(f"`{path}`" for path in aside[:_NAMED])
        more = f" and {len(aside) - _NAMED} more" if len(aside) > _NAMED else ""
        tell(
            f"Unreadable runs are moved to `{session.layout.aside}` and repeated: {listed}{more} "
            "(without a `run.json` of that run and this version)."
        )
    return found


def _refuse_links(layout: Layout, runs: Sequence[Run]) -> None:
    for name in dict.fromkeys(run.variant.name for run in runs):
        if os.path.islink(folder := layout.variant(name)):
            raise StorageError(
                f"{folder}: is a link, so a stored run would change the target of the link",
                hint="replace the link by the folder, or remove the link",
            )
        check_plain(layout.variant_config(name), layout)


def first_free_job(layout: Layout) -> int:
    """The number after that of the last job."""
    names = os.listdir(layout.jobs) if os.path.isdir(layout.jobs) else ()
    numbers = (name.removeprefix("job-") for name in names)
    return max((int(number) for number in numbers if is_run_number(number)), default=-1) + 1


def _set_aside(layout: Layout, run: Run) -> None:
    names = (f"{run.number}" if not n else f"{run.number}.{n}" for n in count())
    places = (layout.aside / run.variant.name / name for name in names)
    place = next(place for place in places if not os.path.lexists(place))
    make_folder(place.parent)
    os.rename(layout.run(run.path), place)


@contextmanager
def storage_errors(root: Path) -> Iterator[None]:
    """Convert an error of the file system to one with a remedy."""
    try:
        yield
    except OSError as error:
        if error.errno in {errno.ENOSPC, errno.EDQUOT}:
            cause, remedy = "the disk is full", "free some space"
        else:
            cause, remedy = f"{error.strerror} ({error.filename})", "fix this"
        resume = f"vast exec local run --resume {shlex.quote(str(root))}"
        begun = os.path.isfile(Layout(root).execution_record)
        done = "The runs that were finished are stored" if begun else "Nothing was run"
        more = f"continue with `{resume}`" if begun else "repeat the command"
        raise StorageError(f"{root}: {cause}. {done}", hint=f"{remedy}, then {more}") from error

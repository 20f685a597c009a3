"""The post-processing commands for ROS bags, as a .vast file names them.

Each works on every run below a results folder: a campaign's, a configuration's or one run's. A run
without a bag, and a bag of which not all can be read, are stated and are no failure. Every command
takes `provenance_file`, as all post-processing commands do, and returns its entries instead.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robovast.errors import RobovastError
from robovast.extras import needing
from robovast.results.layout import Layout
from rosbags_common import find_rosbags

if TYPE_CHECKING:
    from robovast.bags.convert import Conversion

Result = tuple[bool, str, list[dict[str, Any]]]
"""Success, message, provenance entries with paths relative to the results folder."""

_PACKAGES = {"lz4", "mcap", "numpy", "orjson", "rosbags", "zstandard"}
_WORTH_PROCESSES = 32 << 20
"""Bytes of bags from which more than one process is worth its start."""


def rosbags_to_csv(
    results_dir: str,
    config_dir: str,
    topics: Sequence[str],
    provenance_file: str | None = None,  # noqa: ARG001
) -> Result:
    """Write the messages of topics to CSV files `<bag>_<topic>.csv`, a column for each field.

    Args:
        results_dir: folder of a campaign, a configuration or a run.
        config_dir: folder of the .vast file, searched for definitions that a bag lacks.
        topics: the topics.
        provenance_file: not used.
    """
    return _convert("rosbags_to_csv", results_dir, config_dir, {"topics": topics})


def rosbags_tf_to_csv(
    results_dir: str,
    config_dir: str,
    frames: Sequence[str] = ("base_link",),
    csv_filename: str = "poses.csv",
    provenance_file: str | None = None,  # noqa: ARG001
) -> Result:
    """Write the poses of frames in `map` [s, m, rad] to one CSV file.

    Args:
        results_dir: folder of a campaign, a configuration or a run.
        config_dir: folder of the .vast file.
        frames: the frames.
        csv_filename: name of the file.
        provenance_file: not used.
    """
    parameters = {"frames": frames, "csv_filename": csv_filename}
    return _convert("rosbags_tf_to_csv", results_dir, config_dir, parameters)


def rosbags_bt_to_csv(
    results_dir: str,
    config_dir: str,
    provenance_file: str | None = None,  # noqa: ARG001
) -> Result:
    """Write every change of a behaviour's status to `behaviors.csv`.

    Args:
        results_dir: folder of a campaign, a configuration or a run.
        config_dir: folder of the .vast file.
        provenance_file: not used.
    """
    return _convert("rosbags_bt_to_csv", results_dir, config_dir, {})


def rosbags_action_to_csv(
    results_dir: str,
    config_dir: str,
    action: str,
    filename_prefix: str | None = None,
    provenance_file: str | None = None,  # noqa: ARG001
) -> Result:
    """Write feedback and status of an action to `<prefix>_feedback.csv` and `<prefix>_status.csv`.

    Args:
        results_dir: folder of a campaign, a configuration or a run.
        config_dir: folder of the .vast file, searched for the action's definition.
        action: name of the action, as `navigate_to_pose`.
        filename_prefix: how the names of the files begin; `action_<action>` when left out.
        provenance_file: not used.
    """
    parameters = {"action": action, "filename_prefix": filename_prefix}
    return _convert("rosbags_action_to_csv", results_dir, config_dir, parameters)


def rosbags_rosout_to_csv(
    results_dir: str,
    config_dir: str,
    min_level: int = 10,
    skip_levels: Sequence[str] = (),
    provenance_file: str | None = None,  # noqa: ARG001
) -> Result:
    """Write what nodes logged to `rosout.csv`.

    Args:
        results_dir: folder of a campaign, a configuration or a run.
        config_dir: folder of the .vast file.
        min_level: lowest level: 10 DEBUG, 20 INFO, 30 WARN, 40 ERROR, 50 FATAL.
        skip_levels: names of levels to leave out.
        provenance_file: not used.
    """
    parameters = {"min_level": min_level, "skip_levels": skip_levels}
    return _convert("rosbags_rosout_to_csv", results_dir, config_dir, parameters)


def rosbags_to_webm(
    results_dir: str,
    config_dir: str,
    topic: str = "/camera/image_raw/compressed",
    fps: float = 30,
    provenance_file: str | None = None,  # noqa: ARG001
) -> Result:
    """Write the images of a topic to a video `<bag>_<topic>.webm`.

    Args:
        results_dir: folder of a campaign, a configuration or a run.
        config_dir: folder of the .vast file.
        topic: a topic of compressed or raw images.
        fps: frame rate where the stamps of images do not advance.
        provenance_file: not used.
    """
    return _convert("rosbags_to_webm", results_dir, config_dir, {"topic": topic, "fps": fps})


def ros_extra() -> AbstractContextManager[None]:
    """Where packages of the extra `ros` are imported."""
    return needing("ros", _PACKAGES, "reading ROS bags")


def _convert(
    command: str, results_dir: str, config_dir: str, parameters: Mapping[str, Any]
) -> Result:
    """Do one job on all runs below a folder."""
    base = Path(results_dir)
    try:
        with ros_extra():
            from robovast.bags.convert import convert_run
            from robovast.bags.jobs import job_of
        job = job_of(command, parameters)
        runs = _runs(base)
        work = partial(convert_run, jobs=[job], definitions=Path(config_dir))
        conversions = list(_mapped(work, runs))
    except RobovastError as error:
        return False, str(error), []
    entries = [entry for done in conversions for entry in done.provenance(base)]
    return True, _message(base, runs, conversions), entries


def _runs(base: Path) -> list[Path]:
    """Run folders at or below a folder of a campaign, a configuration or a run."""
    if base.name.isdigit():
        return [base]
    below = [path for path in base.iterdir() if path.name.isdigit() and path.is_dir()]
    if below:
        return sorted(below, key=lambda path: int(path.name))
    return list(Layout(base).run_folders()) or [base]


def _mapped(work: partial[Conversion], runs: list[Path]) -> Iterator[Conversion]:
    """What comes out of each run, in order; large bags are shared among processes."""
    count = min(len(os.sched_getaffinity(0)), len(runs))
    if count < 2 or sum(map(_size, runs)) < _WORTH_PROCESSES:
        yield from map(work, runs)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(count, mp_context=context) as pool:
        yield from pool.map(work, runs)


def _size(run: Path) -> int:
    bags = (Path(bag) for bag in find_rosbags(run))
    return sum(path.stat().st_size for bag in bags for path in bag.iterdir())


def _message(base: Path, runs: list[Path], conversions: list[Conversion]) -> str:
    files = sum(len(done.outputs) for done in conversions)
    lines = [f"{files} files of {len(runs)} runs"]
    for run, done in zip(runs, conversions, strict=True):
        name = "" if run == base else f"{run.relative_to(base)}: "
        lines += (f"{name}{warning}" for warning in done.warnings)
    return "\n".join(lines)

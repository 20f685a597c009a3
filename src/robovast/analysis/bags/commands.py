"""The postprocessing commands for ROS bags.

Each command processes all runs in a results folder: of a campaign, a configuration or a single run.
Missing and damaged bags are reported but are not failures. Like all postprocessing commands, these
accept `provenance_file`, but they return provenance entries instead of writing them.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robovast.base.errors import RobovastError
from robovast.base.optional_deps import ROS
from robovast.campaign.layout import Layout
from robovast.model.document.commands import JOB_LOGS, BagCommand, bag_command, expanded
from robovast.model.document.section import PluginCall
from robovast.model.naming import is_run_number
from rosbags_common import find_rosbags

if TYPE_CHECKING:
    from robovast.analysis.bags.convert import Conversion

Result = tuple[bool, str, list[dict[str, Any]]]
"""Success, message, and provenance entries with paths relative to the results folder."""

_WORTH_PROCESSES = 32 << 20
"""Size of bags [bytes] above which several processes are used."""


def rosbags_to_csv(
    results_dir: str,
    config_dir: str,
    topics: Sequence[str] = (),
    bag_dir: str = "rosbag2",
    provenance_file: str | None = None,  # noqa: ARG001
) -> Result:
    """Write the messages of topics to CSV files `<bag>_<topic>.csv`, a column for each field.

    Args:
        results_dir: folder of a campaign, a configuration or a run.
        config_dir: folder of the .vast file; also searched for message definitions.
        topics: the topics; nothing is done without any.
        bag_dir: path suffix of the bag's folder.
        provenance_file: not used.
    """
    parameters = {"topics": topics, "bag_dir": bag_dir}
    return _convert(_call("rosbags_to_csv", parameters), results_dir, config_dir)


def rosbags_tf_to_csv(
    results_dir: str,
    config_dir: str,
    frames: Sequence[str] = ("base_link",),
    csv_filename: str = "poses.csv",
    bag_dir: str = "rosbag2",
    provenance_file: str | None = None,  # noqa: ARG001
    root_frame: str = "map",
    tf_topic: str = "/tf",
) -> Result:
    """Write the poses of frames in a root frame [s, m, rad] to one CSV file.

    Args:
        results_dir: folder of a campaign, a configuration or a run.
        config_dir: folder of the .vast file.
        frames: the frames.
        csv_filename: name of the file.
        bag_dir: path suffix of the bag's folder.
        provenance_file: not used.
        root_frame: the frame that poses are given in.
        tf_topic: topic of the transforms, for example `/robot1/tf`; fixed transforms are on
            `<tf_topic>_static`.
    """
    parameters = {
        "frames": frames,
        "csv_filename": csv_filename,
        "bag_dir": bag_dir,
        "root_frame": root_frame,
        "tf_topic": tf_topic,
    }
    return _convert(_call("rosbags_tf_to_csv", parameters), results_dir, config_dir)


def rosbags_bt_to_csv(
    results_dir: str,
    config_dir: str,
    csv_filename: str = "behaviors.csv",
    bag_dir: str = "rosbag2",
    provenance_file: str | None = None,  # noqa: ARG001
) -> Result:
    """Write every change of a behaviour's status to one CSV file.

    Args:
        results_dir: folder of a campaign, a configuration or a run.
        config_dir: folder of the .vast file.
        csv_filename: name of the file.
        bag_dir: path suffix of the bag's folder.
        provenance_file: not used.
    """
    parameters = {"csv_filename": csv_filename, "bag_dir": bag_dir}
    return _convert(_call("rosbags_bt_to_csv", parameters), results_dir, config_dir)


def rosbags_action_to_csv(
    results_dir: str,
    config_dir: str,
    action: str,
    filename_prefix: str | None = None,
    bag_dir: str = "rosbag2",
    provenance_file: str | None = None,  # noqa: ARG001
) -> Result:
    """Write feedback and status of an action to `<prefix>_feedback.csv` and `<prefix>_status.csv`.

    Args:
        results_dir: folder of a campaign, a configuration or a run.
        config_dir: folder of the .vast file; also searched for the action's definition.
        action: name of the action, such as `navigate_to_pose`.
        filename_prefix: prefix of the file names; by default `action_<action>`.
        bag_dir: path suffix of the bag's folder.
        provenance_file: not used.
    """
    parameters = {"action": action, "filename_prefix": filename_prefix, "bag_dir": bag_dir}
    return _convert(_call("rosbags_action_to_csv", parameters), results_dir, config_dir)


def rosbags_rosout_to_csv(
    results_dir: str,
    config_dir: str,
    min_level: str | int = "DEBUG",
    skip_levels: Sequence[str] = (),
    csv_filename: str = "rosout.csv",
    bag_dir: str = JOB_LOGS,
    provenance_file: str | None = None,  # noqa: ARG001
) -> Result:
    """Write the log messages of nodes to one CSV file.

    Args:
        results_dir: folder of a campaign, a configuration or a run.
        config_dir: folder of the .vast file.
        min_level: lowest level: DEBUG, INFO, WARN, ERROR or FATAL, or its number (10 to 50).
        skip_levels: names of levels to leave out.
        csv_filename: name of the file.
        bag_dir: path suffix of the bag's folder; by default the run's bag with log messages, or
            else the recording of its job.
        provenance_file: not used.
    """
    parameters = {
        "min_level": min_level,
        "skip_levels": skip_levels,
        "csv_filename": csv_filename,
        "bag_dir": bag_dir,
    }
    return _convert(_call("rosbags_rosout_to_csv", parameters), results_dir, config_dir)


def rosbags_to_webm(
    results_dir: str,
    config_dir: str,
    topic: str = "/camera/image_raw/compressed",
    fps: float = 30,
    bag_dir: str = "rosbag2",
    provenance_file: str | None = None,  # noqa: ARG001
) -> Result:
    """Write the images of a topic to a video `<bag>_<topic>.webm`.

    Args:
        results_dir: folder of a campaign, a configuration or a run.
        config_dir: folder of the .vast file.
        topic: a topic of compressed or raw images.
        fps: frame rate where the stamps of images do not advance.
        bag_dir: path suffix of the bag's folder.
        provenance_file: not used.
    """
    parameters = {"topic": topic, "fps": fps, "bag_dir": bag_dir}
    return _convert(_call("rosbags_to_webm", parameters), results_dir, config_dir)


def rosbags_process(
    results_dir: str,
    config_dir: str,
    plugins: Sequence[Mapping[str, Any]] = (),
    workers: int | None = None,  # noqa: ARG001
    bag_dir: str | None = None,
    provenance_file: str | None = None,  # noqa: ARG001
) -> Result:
    """Execute several bag commands in one pass over each bag.

    Args:
        results_dir: folder of a campaign, a configuration or a run.
        config_dir: folder of the .vast file; also searched for message definitions.
        plugins: mappings of `type`, a command's name without `rosbags_`, and its parameters.
        workers: not used; runs are processed in parallel anyway.
        bag_dir: path suffix of the bag's folder, for commands that do not set it.
        provenance_file: not used.
    """
    parameters = {"plugins": list(plugins), "bag_dir": bag_dir}
    return _convert(_call("rosbags_process", parameters), results_dir, config_dir)


def _call(name: str, parameters: Mapping[str, Any]) -> PluginCall:
    return PluginCall(name=name, parameters=dict(parameters))


def _convert(call: PluginCall, results_dir: str, config_dir: str) -> Result:
    """Execute a command on all runs in a folder."""
    base = Path(results_dir)
    try:
        ROS.require("reading ROS bags")
        jobs = [bag_command(part.name, part.parameters) for part in expanded([call])]
        runs = _runs(base)
        conversions = list(_mapped(jobs, Path(config_dir), runs))
    except RobovastError as error:
        return False, str(error), []
    entries = [entry for done in conversions for entry in done.provenance(base)]
    failed = any(done.failures for done in conversions)
    return not failed, _message(base, runs, conversions), entries


def _runs(base: Path) -> list[Path]:
    """Run folders in the folder of a campaign, a configuration or a run."""
    if is_run_number(base.name):
        return [base]
    below = [path for path in base.iterdir() if is_run_number(path.name) and os.path.isdir(path)]
    if below:
        return sorted(below, key=lambda path: int(path.name))
    return list(Layout(base).run_folders()) or [base]


def _mapped(jobs: list[BagCommand], folder: Path, runs: list[Path]) -> Iterator[Conversion]:
    """The conversion of each run, in order; several processes share large bags."""
    from robovast.analysis.bags.convert import convert_run

    work = partial(convert_run, jobs=jobs, definitions=folder)
    count = min(len(os.sched_getaffinity(0)), len(runs))
    if count < 2 or sum(map(_size, runs)) < _WORTH_PROCESSES:
        yield from map(work, runs)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(count, mp_context=context) as pool:
        yield from pool.map(work, runs)


def _size(run: Path) -> int:
    bags = (Path(bag) for bag in find_rosbags(run))
    return sum(path.lstat().st_size for bag in bags for path in bag.iterdir())


def _message(base: Path, runs: list[Path], conversions: list[Conversion]) -> str:
    files = sum(len(done.outputs) for done in conversions)
    lines = [f"{files} files of {len(runs)} runs"]
    for run, done in zip(runs, conversions, strict=True):
        name = "" if run == base else f"{run.relative_to(base)}: "
        lines += (f"{name}{warning}" for warning in done.warnings)
    return "\n".join(lines)

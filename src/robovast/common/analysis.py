"""Reading results in notebooks, as pandas data frames (extra `analysis`)."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from robovast.results.verdict import read_test_result

RunStatus = tuple[str, str, float | None]
"""Verdict (`passed`, `failed`, `errored`), reason and duration [s]."""


def _is_run(path: Path) -> bool:
    return path.name.isdigit() or (path / "test.xml").is_file()


def _run_folders(data_dir: Path) -> list[Path]:
    """Run folders at or below a run's, a configuration's or a campaign's folder."""
    if _is_run(data_dir):
        return [data_dir]
    below = [path for path in _folders(data_dir) if _is_run(path)]
    if below:
        return sorted(below, key=lambda path: (len(path.name), path.name))
    return [run for config in sorted(_folders(data_dir)) for run in _run_folders(config)]


def _folders(path: Path) -> Iterator[Path]:
    return (p for p in path.iterdir() if p.is_dir() and not p.name.startswith(("_", ".")))


def _identity(data_dir: Path, run: Path) -> dict[str, Any]:
    """Columns that tell a run from the others below `data_dir`."""
    depth = len(run.relative_to(data_dir).parts)
    columns: dict[str, Any] = {}
    if depth >= 1:
        columns["run"] = int(run.name) if run.name.isdigit() else run.name
    if depth >= 2:
        columns["config"] = run.parent.name
        columns["test"] = f"{run.parent.name}/{run.name}"
    return columns


def for_each_run(
    data_dir: str | Path, func: Callable[[Path], Any], debug: bool = False
) -> list[Any]:
    """What a function returns for every run folder at or below `data_dir`.

    A run for which it raises is left out, with a warning.

    Args:
        data_dir: folder of a run, a configuration or a campaign.
        func: is called with the folder of a run.
        debug: print each folder.
    """
    return [result for _, result in _results(Path(data_dir), func, debug)]


def _results(
    data_dir: Path, func: Callable[[Path], Any], debug: bool
) -> Iterator[tuple[Path, Any]]:
    for run in _run_folders(data_dir):
        if debug:
            print(run)  # noqa: T201
        try:
            result = func(run)
        except (OSError, ValueError, KeyError, yaml.YAMLError) as error:
            warnings.warn(f"{run}: left out: {error}", stacklevel=3)
        else:
            yield run, result


def read_output_files(
    data_dir: str | Path, reader_func: Callable[[Path], pd.DataFrame], debug: bool = False
) -> pd.DataFrame:
    """The data frames that a reader makes of every run, one below the other.

    Args:
        data_dir: folder of a run, a configuration or a campaign.
        reader_func: makes a data frame of a run's folder, as
            `lambda run: read_output_csv(run, "poses.csv")`.
        debug: print each folder.

    Returns:
        All rows, with the columns `run` (from a configuration's folder on) and `config` and `test`
        (from a campaign's folder on).
    """
    base = Path(data_dir)
    frames = []
    for run, frame in _results(base, reader_func, debug):
        frames.append(frame.assign(**_identity(base, run)))
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()


def read_output_csv(run_dir: str | Path, filename: str, skiprows: int = 0) -> pd.DataFrame:
    """A CSV file of a run.

    Raises:
        FileNotFoundError: the run has no such file.
    """
    return pd.read_csv(Path(run_dir) / filename, skiprows=skiprows)


def read_output_yaml_list(
    run_dir: str | Path, filename: str, list_key: str, merge_level: int = 0
) -> pd.DataFrame:
    """A list in a YAML file of a run as rows.

    Args:
        run_dir: folder of the run.
        filename: the YAML file.
        list_key: key of the list.
        merge_level: how many levels of nested mappings become columns `a.b`.
    """
    data = yaml.safe_load((Path(run_dir) / filename).read_text(encoding="utf-8"))
    return pd.json_normalize(data[list_key], max_level=merge_level)


def get_run_status(run_dir: str | Path) -> RunStatus:
    """Verdict, reason and duration [s] of a run, from its test.xml."""
    result = read_test_result(Path(run_dir))
    return str(result.verdict), result.reason, result.duration


def read_run_statuses(data_dir: str | Path) -> pd.DataFrame:
    """One row per run: `status`, `reason`, `duration` [s], and the columns that identify it."""

    def read(run: Path) -> pd.DataFrame:
        status, reason, duration = get_run_status(run)
        return pd.DataFrame([{"status": status, "reason": reason, "duration": duration}])

    return read_output_files(data_dir, read)


def get_scenario_parameter(data_dir: str | Path, parameter_name: str) -> Any:
    """A scenario parameter of the configuration that a folder belongs to; None when it has none.

    Args:
        data_dir: folder of a run or a configuration.
        parameter_name: the scenario parameter.

    Raises:
        FileNotFoundError: there is no `_config/scenario.config` at or above the folder.
    """
    folder = Path(data_dir).absolute()
    for candidate in (folder, *folder.parents[:2]):
        path = candidate / "_config" / "scenario.config"
        if path.is_file():
            data = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
            values = next(iter(data.values()), None) or {}
            return values.get(parameter_name)
    raise FileNotFoundError(f"{folder}: no _config/scenario.config here or in the folders above")


def print_bag_topics(bag_path: str | Path, bag_dir_name: str = "rosbag2") -> None:
    """Print topics, types and message counts of a run's bag, from its metadata."""
    folder = Path(bag_path)
    folder = folder / bag_dir_name if (folder / bag_dir_name).is_dir() else folder
    data = yaml.safe_load((folder / "metadata.yaml").read_text(encoding="utf-8"))
    for topic in data["rosbag2_bagfile_information"]["topics_with_message_count"]:
        info = topic["topic_metadata"]
        print(f"{info['name']}  {info['type']}  {topic['message_count']}")  # noqa: T201


def get_behavior_info(name: str, dataframe: pd.DataFrame) -> pd.DataFrame:
    """Every execution of a behaviour: rows `start`, `end`, `duration` [s], `status_name`.

    Args:
        name: the behaviour's name.
        dataframe: content of behaviors.csv (`timestamp`, `behavior_name`, `status_name`).
    """
    rows = dataframe[dataframe["behavior_name"] == name].sort_values("timestamp")
    found: list[dict[str, Any]] = []
    start: float | None = None
    for timestamp, status in zip(rows["timestamp"], rows["status_name"], strict=True):
        if status == "RUNNING":
            start = timestamp if start is None else start
        elif status in {"SUCCESS", "FAILURE"}:
            begin = timestamp if start is None else start
            found.append(
                {
                    "start": begin,
                    "end": timestamp,
                    "duration": timestamp - begin,
                    "status_name": status,
                }
            )
            start = None
    return pd.DataFrame(found, columns=["start", "end", "duration", "status_name"])


def calculate_speeds_from_poses(dataframe: pd.DataFrame) -> pd.DataFrame:
    """Poses with the columns `dt` [s], `distance` [m] and `speed` [m/s] since the pose before.

    Args:
        dataframe: content of poses.csv (`timestamp` [s], `position.x`, `.y`, `.z` [m]); rows of
            several runs or frames are told apart by the columns `test`, `run`, `config`, `frame`.
    """
    groups = [column for column in ("test", "run", "config", "frame") if column in dataframe]
    frame = dataframe.sort_values([*groups, "timestamp"])
    columns = ["timestamp", *(c for c in frame if re.fullmatch(r"position\.[xyz]", str(c)))]
    step = (frame.groupby(groups, sort=False)[columns] if groups else frame[columns]).diff()
    distance = (step.drop(columns="timestamp") ** 2).sum(axis=1, min_count=1) ** 0.5
    moving = step["timestamp"] > 0
    speed = (distance / step["timestamp"]).where(moving)
    return frame.assign(dt=step["timestamp"], distance=distance, speed=speed)

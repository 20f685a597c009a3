"""Reads results for notebooks from the folder of a run, a configuration or a campaign."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from numpy.typing import NDArray

from robovast.analysis.episodes import episode_starts
from robovast.base.safe_paths import open_file, read_file
from robovast.base.yaml_files import parse_yaml, read_mapping
from robovast.campaign.layout import RUN_RECORD, SCENARIO_CONFIG, TEST_RESULT, VARIANT_RECORD
from robovast.campaign.run_record import read_run_record
from robovast.campaign.verdict import Verdict, read_report, read_test_result
from robovast.model.variations.factors import factor_values

_SHORTEST_STEP = 1e-6
"""Shorter steps have no speed [s]."""


def for_each_run(
    data_dir: str | Path, func: Callable[[Path], Any], debug: bool = False
) -> list[Any]:
    """Call a function for every run in `data_dir` and return its results.

    Exceptions of the function are printed and do not stop the others.

    Args:
        data_dir: folder of a run, a configuration or a campaign.
        func: called with each run's folder.
        debug: print each folder.

    Raises:
        ValueError: the folder is missing or contains no run.
    """
    results = []
    for run in _run_folders(data_dir):
        if debug:
            print(run)  # noqa: T201
        try:
            results.append(func(run))
        except Exception as error:  # a notebook's function may raise anything
            print(f"{run}: {type(error).__name__}: {error}")  # noqa: T201
    return results


def read_output_files(
    data_dir: str | Path,
    reader_func: Callable[[Path], pd.DataFrame | None],
    debug: bool = False,
) -> pd.DataFrame:
    """Concatenate the data frames that a reader function makes from each run.

    Runs for which the reader raises are left out with one warning; a reader may return None for a
    run without rows.

    Args:
        data_dir: folder of a run, a configuration or a campaign.
        reader_func: makes a data frame from a run's folder, such as
            `lambda run: read_output_csv(run, "poses.csv")`.
        debug: print each folder.

    Returns:
        All rows. The reader's columns are followed by `run` (text), `config` and each scenario
        parameter (mappings and lists as YAML), which replace columns of the same name and are all
        categorical; NaN if a configuration lacks the parameter.

    Raises:
        ValueError: the folder is missing, contains no run, or no run could be read.
    """
    frames: list[pd.DataFrame] = []
    failed: list[str] = []
    added: dict[str, None] = {}
    runs = _run_folders(data_dir)
    for run in runs:
        if debug:
            print(run)  # noqa: T201
        try:
            frame = reader_func(run)
        except Exception as error:  # a notebook's reader may raise anything
            failed.append(f"{run.parent.name}/{run.name}: {_error_text(error)}")
            continue
        columns = {"run": run.name, "config": run.parent.name, **_scenario_parameters(run.parent)}
        added.update(dict.fromkeys(columns))
        if frame is not None:
            own = frame.drop(columns=[name for name in columns if name in frame])
            frames.append(own.assign(**columns))
    if failed and not frames:
        raise ValueError(
            f"{data_dir}: none of its {len(runs)} runs could be read: {_first_of(failed)}"
        )
    if failed:
        warnings.warn(
            f"{len(failed)} of {len(runs)} runs are skipped: {_first_of(failed)}", stacklevel=2
        )
    return _categorical(pd.concat(frames, ignore_index=True), added) if frames else pd.DataFrame()


def _error_text(error: Exception) -> str:
    """Describe an error, common ones without Python's terms."""
    if isinstance(error, FileNotFoundError) and error.filename is not None:
        return f"it has no {error.filename}"
    return f"{type(error).__name__}: {error}"


def _first_of(failed: list[str]) -> str:
    more = f" (and {len(failed) - 1} more)" if len(failed) > 1 else ""
    return failed[0] + more


def _categorical(frame: pd.DataFrame, names: Iterable[str]) -> pd.DataFrame:
    """Move these columns to the end of the frame and make them categorical."""
    last = [name for name in names if name in frame]
    own = [name for name in frame if name not in last]
    return frame[[*own, *last]].astype(dict.fromkeys(last, "category"))


def _run_folders(data_dir: str | Path) -> list[Path]:
    root = Path(os.path.abspath(data_dir))  # the names of run and configuration are needed
    if not os.path.isdir(root):
        raise ValueError(f"{data_dir}: no such folder")
    runs = sorted(_runs_below(root), key=lambda run: (*run.parts[:-1], len(run.name), run.name))
    if not runs:
        raise ValueError(f"{data_dir}: there is no run in this folder")
    return runs


def _runs_below(folder: Path) -> Iterator[Path]:
    """Folders at or below a folder that have a verdict or a record; they are not searched further.

    A campaign's `_config`, `_jobs` and hidden folders contain no runs.
    """
    if os.path.isfile(folder / TEST_RESULT) or os.path.isfile(folder / RUN_RECORD):
        yield folder
        return
    for path in folder.iterdir():
        if (
            os.path.isdir(path)
            and not os.path.islink(path)
            and not path.name.startswith(("_", "."))
        ):
            yield from _runs_below(path)


def _scenario_parameters(config_dir: Path) -> dict[str, Any]:
    """Scenario parameters of a configuration, by name; mappings and lists as YAML text."""
    try:
        parameters = _read_scenario_parameters(config_dir)
    except FileNotFoundError:
        return {}
    return {name: _as_category(parameters[name]) for name in sorted(parameters)}


def _as_category(value: Any) -> Any:
    if isinstance(value, dict | list):
        return yaml.safe_dump(value, default_flow_style=False)
    return value


def _read_scenario_parameters(config_dir: Path) -> Mapping[str, Any]:
    path = config_dir / SCENARIO_CONFIG
    scenarios = parse_yaml(read_file(path)) or {}
    return next(iter(scenarios.values()), None) or {}


def get_scenario_parameter(data_dir: str | Path, parameter_name: str) -> Any:
    """A scenario parameter of a folder's configuration; None if it is not set.

    Args:
        data_dir: folder of a run or a configuration.
        parameter_name: the scenario parameter.

    Raises:
        FileNotFoundError: there is no `_config/scenario.config` at or above the folder.
    """
    return _read_scenario_parameters(_config_dir(data_dir)).get(parameter_name)


def get_factors(data_dir: str | Path) -> dict[str, Any]:
    """What was varied in a folder's configuration: its factors, otherwise its scenario parameters.

    Args:
        data_dir: folder of a run or a configuration.

    Raises:
        FileNotFoundError: there is no `_config/scenario.config` at or above the folder.
    """
    config_dir = _config_dir(data_dir)
    stated = factor_values(read_mapping(config_dir / VARIANT_RECORD).get("factors"))
    return stated or dict(_read_scenario_parameters(config_dir))


def _config_dir(data_dir: str | Path) -> Path:
    """The folder of the configuration that a folder belongs to."""
    folder = Path(data_dir).absolute()
    for candidate in (folder, *folder.parents[:2]):
        if os.path.isfile(candidate / SCENARIO_CONFIG):
            return candidate
    raise FileNotFoundError(f"{folder}: no {SCENARIO_CONFIG} here or in the folders above")


def read_output_csv(run_dir: str | Path, filename: str, skiprows: int = 0) -> pd.DataFrame:
    """Read a CSV file of a run.

    Args:
        run_dir: folder of the run.
        filename: the CSV file.
        skiprows: number of lines before the header.

    Raises:
        FileNotFoundError: the file is missing.
    """
    path = Path(run_dir) / filename
    open_file(path).close()  # refuse pipes, which would block
    return pd.read_csv(path, skiprows=skiprows)


def read_output_yaml_list(
    run_dir: str | Path, filename: str, list_key: str, merge_level: int = 0
) -> pd.DataFrame:
    """Read a list in a YAML file of a run as rows.

    Args:
        run_dir: folder of the run.
        filename: the YAML file.
        list_key: key of the list.
        merge_level: number of nested levels that become columns such as `a_b`, `a_0`.

    Raises:
        FileNotFoundError: the file is missing.
        KeyError: the file lacks the key.
        ValueError: the value is not a list.
    """
    data = parse_yaml(read_file(Path(run_dir) / filename)) or {}
    items = data[list_key]
    if not isinstance(items, list):
        raise ValueError(f"{filename}: `{list_key}` is not a list")
    return pd.DataFrame([_flat(item, merge_level) for item in items])


def _flat(item: Any, levels: int) -> dict[str, Any]:
    """The values of a nested item by their path of names and indexes."""
    row: dict[str, Any] = {}
    for name, value in _children(item):
        inside = list(_children(value)) if levels > 0 else []
        if not inside:
            row[name] = value
            continue
        row.update((f"{name}_{below}", v) for below, v in _flat(value, levels - 1).items())
    return row


def _children(value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        yield from ((str(name), child) for name, child in value.items())
    elif isinstance(value, list):
        yield from ((str(index), child) for index, child in enumerate(value))


def get_run_status(run_dir: str | Path) -> tuple[str, str | None]:
    """A run's status (`passed`, `failed`, or `unknown` without a verdict) and a summary.

    A failure's summary is the message of the failed behaviour, else of the last successful one,
    else the failure's own message if it is a single line, else None. Without a verdict, the summary
    is the reason in the run's record.
    """
    run = Path(run_dir)
    record = read_run_record(run)
    if record is not None and record.verdict in {Verdict.ERRORED, Verdict.INTERRUPTED}:
        return "unknown", record.reason or None
    verdict = read_test_result(run).verdict
    if verdict is Verdict.PASSED:
        return "passed", None
    if verdict is Verdict.FAILED:
        return "failed", _failure_summary(run)
    return "unknown", None


def _failure_summary(run: Path) -> str | None:
    """The message of the behaviour that made a run fail, from the tree in its test.xml."""
    root = read_report(run)
    found = next((e for kind in ("failure", "error") for e in root.iter(kind)), None)
    if found is None:
        return None
    lines: list[str] = [
        *(found.get("message") or "").splitlines(),
        *(found.text or "").splitlines(),
    ]
    for mark in ("[✕] -- ", "[✓] -- "):
        marked = [line.partition(mark)[2].strip() for line in lines if mark in line]
        if marked:
            return marked[-1]
    said = [line.strip() for line in lines if line.strip()]
    return said[0] if len(said) == 1 else None


def read_run_statuses(data_dir: str | Path) -> pd.DataFrame:
    """One row per run, sorted by path: `run`, `config`, `status`, `summary`; see `get_run_status`.

    There are no columns if there is no run.

    Raises:
        ValueError: the folder is missing.
    """
    root = Path(data_dir)
    if not os.path.isdir(root):
        raise ValueError(f"{data_dir}: no such folder")
    rows = []
    for run in sorted(_runs_below(root.absolute())):
        status, summary = get_run_status(run)
        rows.append(
            {"run": run.name, "config": run.parent.name, "status": status, "summary": summary}
        )
    return pd.DataFrame(rows)


_EXECUTION = ["behavior_id", "run", "config"]
_BEHAVIOR_INFO = ["behavior_name", "id", "start_time", "end_time", "duration", "run", "config"]


def get_behavior_info(behavior_name: str, behavior_dataframe: pd.DataFrame) -> pd.DataFrame:
    """All executions of a behaviour, from its first RUNNING to its first SUCCESS or FAILURE.

    Args:
        behavior_name: the behaviour's name.
        behavior_dataframe: content of behaviors.csv (`timestamp`, `behavior_name`,
            `behavior_id`, `status_name`) with the columns `run` and `config`, as returned by
            `read_output_files`.

    Returns:
        Rows `behavior_name, id, start_time, end_time, duration, run, config` [s]; executions
        without a start or an end are left out.

    Raises:
        KeyError: a column is missing.
    """
    named = behavior_dataframe[behavior_dataframe["behavior_name"] == behavior_name]
    groups = named.groupby(_EXECUTION, sort=False, observed=True)
    if named.empty:
        return pd.DataFrame(columns=["behavior_name", "id", "duration", "run", "config"])
    executions = []
    for (id_, run, config), rows in groups:
        times = _execution_times(rows)
        if times is not None:
            start, end = times
            executions.append((behavior_name, id_, start, end, end - start, run, config))
    return pd.DataFrame(executions, columns=_BEHAVIOR_INFO) if executions else pd.DataFrame()


def _execution_times(rows: pd.DataFrame) -> tuple[float, float] | None:
    started = rows.loc[rows["status_name"] == "RUNNING", "timestamp"]
    ended = rows.loc[rows["status_name"].isin(["SUCCESS", "FAILURE"]), "timestamp"]
    return None if started.empty or ended.empty else (started.iloc[0], ended.iloc[0])


_SPEEDS = [
    *("run", "config", "position.x", "position.y", "orientation.yaw", "timestamp"),
    *("linear_speed", "angular_speed", "dt"),
]


_GROUPS: Any = {"sort": False, "observed": True, "dropna": False}
_JUMPS = "jumps back in time"


def _jumps(times: pd.Series[float]) -> NDArray[np.int64]:
    """Return the number of jumps back in time up to each of n timestamps [s]."""
    stamps = np.nan_to_num(times.to_numpy(float) * 1e9).astype(np.int64)
    numbers = np.zeros_like(stamps)
    numbers[episode_starts(stamps, numbers)] = 1
    return np.cumsum(numbers)


def calculate_speeds_from_poses(df: pd.DataFrame) -> pd.DataFrame:
    """Return speeds between consecutive poses of the same run, frame and episode.

    Args:
        df: content of poses.csv (`timestamp` [s], `position.x`, `position.y` [m],
            `orientation.yaw` [rad]); the columns `run`, `config`, `frame` and `episode` separate
            runs, frames and episodes. A timestamp that jumps back begins an episode, too.

    Returns:
        Rows `run, config, position.x, position.y, orientation.yaw, timestamp, linear_speed` [m/s],
        `angular_speed` [rad/s], `dt` [s]; without the last pose of each episode, and without poses
        that are followed by another within a microsecond.
    """
    groups = [name for name in ("run", "config", "frame", "episode") if name in df]
    times = df.groupby(groups, **_GROUPS)["timestamp"] if groups else df["timestamp"]
    df = df.assign(**{_JUMPS: times.transform(_jumps)})
    groups.append(_JUMPS)
    ordered = df.sort_values([*groups, "timestamp"], kind="stable")
    values = ["timestamp", "position.x", "position.y", "orientation.yaw"]
    ahead = ordered.groupby(groups, **_GROUPS)[values].shift(-1)
    step = ahead - ordered[values]
    turn = (step["orientation.yaw"] + math.pi) % (2 * math.pi) - math.pi
    distance = (step["position.x"] ** 2 + step["position.y"] ** 2) ** 0.5
    speeds = ordered.assign(
        linear_speed=distance / step["timestamp"],
        angular_speed=turn.abs() / step["timestamp"],
        dt=step["timestamp"],
    )
    moving = speeds[step["timestamp"] > _SHORTEST_STEP]
    return moving[[name for name in _SPEEDS if name in moving]].reset_index(drop=True)

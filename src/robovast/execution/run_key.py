"""Keys of runs: equal keys mean that all that RoboVAST gives to two runs is equal.

A key covers the executed image, the shared files with the scenario and the contract, environment,
limits, timeout, and of the run its path, seed, parameters and files. A run of a pack also depends
on those before it in the same start.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

from robovast.base.serialization import fingerprint
from robovast.common.execution import COMPAT_VERSION
from robovast.execution.job_config import SEED_VARIABLE, is_pack, parameter_documents
from robovast.model.plan import PackStart, Run
from robovast.model.scenario import Scenario

_VERSION = 1
"""Of what a key covers: a change makes all earlier keys different."""
_OF_ONE_CAMPAIGN = (
    "CAMPAIGN_ID",
    "OUTPUT_DIR",
    "SCENARIO_OUTPUT_DIR",
    "ROBOVAST_CONFIG_DIR",
    "ROBOVAST_OUT_DIR",
    SEED_VARIABLE,
)
"""Variables that name the campaign or its folders, or that each run has for itself."""


def common_key(settings: Mapping[str, Any], files: Path) -> str:
    """The part of the keys that all runs of a campaign share.

    Args:
        settings: how runs are executed; `environment` are the variables of a job.
        files: the folder of the shared files.
    """
    environment = settings["environment"]
    own = {name: environment[name] for name in environment if name not in _OF_ONE_CAMPAIGN}
    found = sorted(path for path in files.rglob("*") if path.is_file())
    content = {path.relative_to(files).as_posix(): _content(path) for path in found}
    return fingerprint(
        [_VERSION, COMPAT_VERSION, _plain({**settings, "environment": own}), content]
    )


def run_keys(common: str, job: PackStart, scenario: Scenario) -> dict[int, str]:
    """The key of each run of a job by id; all are empty if the common part is."""
    return chained_keys(common, job, own_parts(job.runs, scenario))


def chained_keys(common: str, job: PackStart, own: Mapping[int, list[Any]]) -> dict[int, str]:
    """The same from the runs' own parts, by id."""
    if not common:
        return dict.fromkeys((run.id for run in job.runs), "")
    keys = {}
    key = fingerprint([common, is_pack(job)])
    for run in job.runs:
        key = keys[run.id] = fingerprint([key, own[run.id]])
    return keys


def own_parts(runs: Iterable[Run], scenario: Scenario) -> dict[int, list[Any]]:
    """What is each run's own in its key, as plain data by id."""
    return {run.id: _own(run, scenario) for run in runs}


def _own(run: Run, scenario: Scenario) -> list[Any]:
    parameters = parameter_documents(PackStart(0, (run,)), scenario)
    files = {file.name: _content(Path(file.source)) for file in run.variant.files}
    return [run.path, run.seed, parameters, files]


def _content(path: Path) -> list[Any]:
    with path.open("rb") as file:
        return [hashlib.file_digest(file, "sha256").hexdigest(), os.access(path, os.X_OK)]


def _plain(value: Any) -> Any:
    """Data classes as mappings, at any depth."""
    if is_dataclass(value) and not isinstance(value, type):
        return _plain(asdict(value))
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list) else value

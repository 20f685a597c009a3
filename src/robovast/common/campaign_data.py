"""Reads a campaign's folder into plain Python values, for notebooks and plugins."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from robovast.base.safe_paths import MOST_OF_ALL, is_file, read_file
from robovast.base.yaml_files import parse_yaml
from robovast.campaign import verdict
from robovast.campaign.layout import (
    JOB_LINK,
    RUN_RECORD,
    SCENARIO_CONFIG,
    SYSINFO,
    TEST_RESULT,
    Layout,
    job_folder,
)


def list_config_dirs(campaign_dir: str | Path) -> list[Path]:
    """Folders of a campaign's configurations, by name; empty if the campaign is missing."""
    root = Path(campaign_dir)
    if not os.path.isdir(root):
        return []
    folders = (path for path in root.iterdir() if os.path.isdir(path))
    return sorted(path for path in folders if not path.name.startswith(("_", ".")))


def list_run_dirs(config_dir: str | Path) -> list[Path]:
    """Folders of a configuration's runs, by number; empty if the configuration is missing."""
    folder = Path(config_dir)
    return Layout(folder.parent).run_folders_of(folder.name) if os.path.isdir(folder) else []


def read_test_result(run_dir: str | Path) -> dict[str, Any]:
    """The content of a run's test.xml.

    Returns:
        `success`, `duration_sec`, `start_time` (ISO 8601, UTC; None if unknown), `errors`,
        `failures`, `tests`, and `failure_message` (None when it passed).

    Raises:
        FileNotFoundError: the run has no test.xml.
    """
    path = Path(run_dir) / TEST_RESULT
    if not os.path.isfile(path):
        raise FileNotFoundError(path)
    result = verdict.read_test_result(path.parent)
    started = result.started_at
    return {
        "success": result.verdict is verdict.Verdict.PASSED,
        "duration_sec": result.duration,
        "start_time": None if started is None else datetime.fromtimestamp(started, UTC).isoformat(),
        **_counts(path, result.verdict),
        "failure_message": result.reason or None,
    }


def _counts(path: Path, found: verdict.Verdict) -> dict[str, int]:
    """Numbers of test cases in a test.xml: all, failed, with errors."""
    kinds = {"tests": "testcase", "failures": "failure", "errors": "error"}
    if found is verdict.Verdict.ERRORED:
        return dict.fromkeys(kinds, 0)
    root = verdict.read_report(path.parent)
    return {name: sum(1 for _ in root.iter(tag)) for name, tag in kinds.items()}


def aggregate_run_status(run_dirs: Iterable[str | Path]) -> str:
    """`passed`, `failed`, `mixed`, or `no_runs` if no run has a verdict."""
    results = (verdict.read_test_result(Path(run)).verdict for run in run_dirs)
    said = {str(result) for result in results if result is not verdict.Verdict.ERRORED}
    if len(said) > 1:
        return "mixed"
    return said.pop() if said else "no_runs"


def read_scenario_config(config_dir: str | Path) -> dict[str, Any]:
    """Scenario parameters of a configuration, `{scenario: {parameter: value}}`.

    Raises:
        FileNotFoundError: the configuration's file of parameters is missing.
    """
    return _read_yaml(Path(config_dir) / SCENARIO_CONFIG)


def read_sysinfo(run_dir: str | Path) -> dict[str, Any]:
    """The machine that executed a run.

    Raises:
        FileNotFoundError: neither the run nor its job has a `sysinfo.yaml`.
    """
    run = Path(run_dir)
    own = run / SYSINFO
    return _read_yaml(own if is_file(own, run) else _job_folder(run) / SYSINFO)


def _job_folder(run: Path) -> Path:
    """The folder of a run's job, from its link or, where links were lost, from its record."""
    linked = job_folder(run)
    if linked is not None:
        return linked
    try:
        name = str(json.loads(read_file(run / RUN_RECORD))["job"])
    except (OSError, ValueError, KeyError, TypeError):
        return run / JOB_LINK
    return Layout(run.parent.parent).job(Path(name).name)


def read_execution_metadata(campaign_dir: str | Path) -> dict[str, Any]:
    """The record of a campaign's execution.

    Raises:
        FileNotFoundError: the campaign has no `_execution/execution.yaml`.
    """
    return _read_yaml(Layout(Path(campaign_dir)).execution_record)


def read_resolved_configurations(campaign_dir: str | Path) -> dict[str, Any]:
    """All configurations of a campaign as they were executed.

    Raises:
        FileNotFoundError: the campaign has no `_transient/configurations.yaml`.
    """
    return _read_yaml(Layout(Path(campaign_dir)).configurations)


def _read_yaml(path: Path) -> dict[str, Any]:
    return dict(parse_yaml(read_file(path, most=MOST_OF_ALL)) or {})

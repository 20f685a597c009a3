"""Describes a run: verdict, times, files, system information, bags, postprocessing."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from robovast.analysis.provenance.problems import Findings
from robovast.analysis.provenance.reading import list_files, read_mapping
from robovast.analysis.provenance.times import as_utc, from_epoch
from robovast.base.safe_paths import read_file
from robovast.campaign.layout import POSTPROCESSING, RUN_RECORD, SYSINFO, TEST_RESULT, job_folder
from robovast.campaign.run_record import read_run_record, result_without_record
from robovast.campaign.verdict import Verdict

BAG_PARTS = (".mcap", ".db3")
RUN_BAG = "rosbag2"
BAG_METADATA = "metadata.yaml"


def describe_run(root: Path, variant: str, number: str, findings: Findings) -> dict[str, Any]:
    """A run's entry in `test_results`.

    Args:
        root: the campaign's folder.
        variant: name of the configuration.
        number: name of the run's folder.
        findings: collects missing data.
    """
    where = f"{variant}/{number}"
    folder = root / variant / number
    files = list(list_files(str(folder), f"{where}/"))
    executed_by = job_folder(folder)
    job = executed_by.relative_to(root).as_posix() if executed_by else None
    job_files = list(list_files(str(root / job), f"{job}/")) if job else []
    entry: dict[str, Any] = {"dir": where, **_outcome(folder, where, files, findings)}
    entry["output_files"] = [name for name in files if name != f"{where}/{POSTPROCESSING}"]
    if job:
        entry["job"] = job
        entry["job_files"] = job_files
    sysinfo = _sysinfo([*files, *job_files], where, findings)
    entry["sysinfo"] = read_mapping(root / sysinfo, findings, where) if sysinfo else {}
    if sysinfo:
        entry["sysinfo_file"] = sysinfo
    entry.update(_by_role(_describe_bags(root, files), where))
    has_record = f"{where}/{POSTPROCESSING}" in files
    path = folder / POSTPROCESSING
    entry["postprocessing"] = read_mapping(path, findings, where) if has_record else {}
    return entry


def _outcome(folder: Path, where: str, files: Iterable[str], findings: Findings) -> dict[str, Any]:
    """Verdict and times from `run.json`, or from `test.xml` if another tool executed the run."""
    record = _read_record(folder)
    if f"{where}/{TEST_RESULT}" not in files:
        findings.missing(f"no {TEST_RESULT}", where)
    if record is None:
        if f"{where}/{RUN_RECORD}" in files:
            findings.missing(f"no {RUN_RECORD} that this version understands", where)
        record = _read_result(folder)
    outcome = {
        "success": "true" if record["verdict"] == Verdict.PASSED else "false",
        "verdict": str(record["verdict"]),
        "reason": record["reason"],
        "start_time": as_utc(record["started_at"]),
        "end_time": as_utc(record["finished_at"]),
    }
    if record.get("seed") is not None:
        outcome["seed"] = record["seed"]
    outcome["reused_from"] = record.get("reused_from", "")
    return {name: value for name, value in outcome.items() if value not in ("", None)}


def _read_record(folder: Path) -> dict[str, Any] | None:
    """The relevant part of a run's record; None if it is missing."""
    record = read_run_record(folder)
    keys = ("verdict", "reason", "started_at", "finished_at", "seed", "reused_from")
    return {key: getattr(record, key) for key in keys} if record is not None else None


def _read_result(folder: Path) -> dict[str, Any]:
    result = result_without_record(folder)
    start, duration = result.started_at, result.duration
    end = start + duration if start is not None and duration is not None else None
    return {
        "verdict": result.verdict,
        "reason": result.reason,
        "started_at": from_epoch(start),
        "finished_at": from_epoch(end),
    }


def _sysinfo(files: Iterable[str], where: str, findings: Findings) -> str | None:
    """The run's system information: its own, or its job's."""
    found = next((name for name in files if name.endswith(f"/{SYSINFO}")), None)
    if found is None:
        findings.missing(f"no {SYSINFO}", where)
    return found


def bags_of(entry: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The bags in a run's entry, by folder relative to the run."""
    own = {RUN_BAG: entry[RUN_BAG]} if RUN_BAG in entry else {}
    return {**own, **entry.get("further_bags", {})}


def _by_role(bags: dict[str, dict[str, Any]], where: str) -> dict[str, Any]:
    """The default bag under its own key, and all others beside it."""
    inside = {folder.removeprefix(where).strip("/"): bag for folder, bag in bags.items()}
    own = inside.pop(RUN_BAG, None)
    return {**({RUN_BAG: own} if own else {}), **({"further_bags": inside} if inside else {})}


def _describe_bags(root: Path, files: Iterable[str]) -> dict[str, dict[str, Any]]:
    """The ROS bags among a run's files, by folder."""
    parts: dict[str, list[str]] = {}
    for name in files:
        folder, _, part = name.rpartition("/")
        if part.endswith(BAG_PARTS) or part == BAG_METADATA:
            parts.setdefault(folder, []).append(part)
    return {
        folder: {"files": names, **_bag_content(root / folder / BAG_METADATA)}
        for folder, names in parts.items()
        if any(name.endswith(BAG_PARTS) for name in names)
    }


_DISTRO = re.compile(r"^\W*ros_distro\W+(\w+)", re.MULTILINE)
_TYPE = re.compile(r"\btype['\"]?:\s*['\"]?([A-Za-z]\w*(?:/\w+)+)")


def _bag_content(path: Path) -> dict[str, Any]:
    """A bag's metadata, extracted by regular expressions: a YAML parser would dominate run time."""
    try:
        text = read_file(path).decode("utf-8", "replace")
    except OSError:
        text = ""
    distro = _DISTRO.search(text)
    return {
        "ros_distro": distro[1] if distro else "",
        "message_types": sorted(set(_TYPE.findall(text))),
    }

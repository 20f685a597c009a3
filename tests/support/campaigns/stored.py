"""Campaigns as they are on disk, written without executing anything."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from robovast.base.atomic import write_atomically
from robovast.base.serialization import dump_yaml

START = datetime(2026, 3, 4, 13, 24, 44, tzinfo=UTC).timestamp()
NAME = "hall-2026-03-04-132444"

MOVES = {
    "map_file": "maps/hall.yaml",
    "start": {"x": 1.0, "y": 1.0},
    "goals": [{"x": 3.0, "y": 1.0}],
    "path": [[1.0, 1.0], [3.0, 1.0]],
    "obstacles": [{"x": 2.0, "y": 2.0, "radius": 0.2}],
}

Factors = Callable[[Mapping[str, Any]], Mapping[str, Any]]
"""What was varied, `{name: {value, unit}}`, by parameters."""
Judge = Callable[[Mapping[str, Any], int], str]
"""Verdict of a run, by parameters and number."""

SYSTEM_LOG = """\
[robovast] job job-{job}: scenario_execution
[INFO] [{begin:.6f}] [scenario_execution]: Executing scenario 'drive'
[WARN] [{middle:.6f}] [controller]: \x1b[33mslow\x1b[0m update, 12 ms
[ERROR] [{end:.6f}] [scenario_execution]: <script>window.stolen = true</script> goal not reached
Traceback (most recent call last):
  File "drive.py", line 7, in drive
TimeoutError: no goal after 20 s
[robovast] ended with code 1
"""


def write_campaign(
    results: Path,
    name: str = NAME,
    *,
    variants: Sequence[Mapping[str, Any]] = ({"speed": 1.0}, {"speed": 2.0}),
    runs: int = 2,
    judge: Judge = lambda parameters, number: "passed",
    outputs: bool = True,
    factors: Factors | None = None,
) -> Path:
    """Write a campaign of `variants` × `runs`; returns its folder.

    Without `outputs` a run is its record alone.
    """
    root = results / name
    write(root / "_config" / "hall.vast", "version: 1\n")
    write(
        root / "_execution" / "execution.yaml",
        f"execution_time: '2026-03-04T13:24:44+00:00'\nrobovast_version: 0.1.0\nruns: {runs}\n"
        "execution_type: local\nimage: robots/hall:7\nimage_revision: ''\n",
    )
    for place, parameters in enumerate(variants):
        variant = f"hall-{place + 1}"
        write(root / variant / "_config" / "config.yaml", "config_identifier: abc\n")
        for number in range(runs):
            index = place * runs + number
            write_run(root, variant, number, index, parameters, judge, outputs, factors)
    return root


def write_run(
    root: Path,
    variant: str,
    number: int,
    index: int,
    parameters: Mapping[str, Any],
    judge: Judge,
    outputs: bool = True,
    factors: Factors | None = None,
) -> Path:
    """Write one run and, with `outputs`, its job; returns its folder."""
    verdict = judge(parameters, number)
    begin, seconds = START + 20 * index, 5 + 10 * (index * 0.618 % 1)
    folder = root / variant / str(number)
    record = {
        "campaign": root.name,
        "variant": variant,
        "entry": "hall",
        "run": number,
        "id": index,
        "verdict": verdict,
        "reason": "" if verdict == "passed" else "goal not reached: no goal after 20 s",
        "started_at": _iso(begin),
        "finished_at": _iso(begin + seconds),
        "duration": seconds,
        "exit_code": 0 if verdict == "passed" else 1,
        "attempt": 1,
        "job": f"job-{index}",
        "runtime": "docker",
        "image": "robots/hall:7",
        "image_digest": "",
        "host": "bench",
        "parameters": dict(parameters),
        **({"factors": factors(parameters)} if factors else {}),
        "schema": 1,
    }
    if outputs:
        _write_outputs(root, folder, index, begin, seconds)
    write(folder / "run.json", json.dumps(record))
    return folder


def _write_outputs(root: Path, folder: Path, index: int, begin: float, seconds: float) -> None:
    job = root / "_jobs" / f"job-{index}"
    folder.mkdir(parents=True)
    (folder / "job").symlink_to(Path("..", "..", "_jobs", job.name))
    log = SYSTEM_LOG.format(job=index, begin=begin, middle=begin + 1, end=begin + seconds)
    write(job / "logs" / "system.log", log)
    write(job / "sysinfo.yaml", "platform: {system: Linux, machine: x86_64}\ncpu_name: fast\n")
    write(
        job / "resource_usage_main.csv",
        "timestamp,pid,name,cpu_percent,memory_rss_bytes\n"
        + "".join(
            f"{begin + second},{pid},{name},{40 + 5 * second + pid},{100e6 + 4e6 * second:.0f}\n"
            for second in range(int(seconds))
            for pid, name in ((7, "sim"), (9, "robot"))
        ),
    )
    write(
        folder / "test.xml",
        '<testsuite errors="0" failures="1" time="9.5"><testcase name="drive">'
        '<failure message="goal not reached">no goal after 20 s</failure></testcase></testsuite>',
    )
    poses = (f"{0.1 * i:.1f},{0.05 * i:.3f},{(i % 40) / 40:.3f},base_link\n" for i in range(200))
    write(folder / "poses.csv", "timestamp,position.x,position.y,frame\n" + "".join(poses))


def write(path: Path, text: str) -> None:
    """Write a file and the folders it needs; who reads meanwhile finds all of it or nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, text, lasting=False)


def _iso(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds")


def add_map(root: Path, variant: str) -> Path:
    """Let a configuration move on a map of its own; returns the map's folder."""
    import numpy as np

    from robovast.navigation.occupancy import OccupancyMap, write_map

    folder = root / variant / "_config" / "maps"
    folder.mkdir()
    free = np.ones((30, 40), bool)
    write_map(OccupancyMap(free, ~free, 0.1, (0.0, 0.0)), folder / "hall.yaml")
    record_moves(root, variant, MOVES)
    return folder


def record_moves(root: Path, variant: str, record: Any, **parameters: Any) -> None:
    """What navigation variations have recorded of a configuration, among others."""
    configs = [
        {"name": "another", "_navigation": {"map_file": "another.yaml"}},
        {
            "name": variant,
            "config": {"a": f"- name: {variant}", **parameters},
            "_navigation": record,
        },
        {"name": f"{variant}0", "_navigation": {}},
    ]
    listed = dump_yaml({"vast": "hall.vast", "configs": configs})
    write(root / "_transient" / "configurations.yaml", listed)

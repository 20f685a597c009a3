"""A postprocessing command: what a landing was like, in one row."""

import csv
from pathlib import Path


def landing_metrics(results_dir, config_dir):  # noqa: ARG001
    """Write metrics.csv of a run: duration, speed at the end, distance and fastest descent."""
    run = Path(results_dir)
    source = run / "trajectory.csv"
    if not source.is_file():
        return True, "no trajectory"
    with source.open(newline="") as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    last = rows[-1]
    found = {
        "duration": last["time"],
        "touchdown": -last["speed"],
        "distance": abs(last["aside"]),
        "descent": max(-row["speed"] for row in rows),
    }
    with (run / "metrics.csv").open("w", newline="") as file:
        csv.writer(file).writerows([found.keys(), found.values()])
    return True, ""


landing_metrics.per_run = True

#!/usr/bin/env python3
"""Runs after each scenario, with the run's folder: writes `summary.csv` from its samples."""

import csv
import sys
from pathlib import Path


def main() -> int:
    folder = Path(sys.argv[1])
    with (folder / "samples.csv").open(newline="") as file:
        values = [float(row["value"]) for row in csv.DictReader(file)]
    mean = sum(values) / len(values)
    summary = f"samples,mean,least,largest\n{len(values)},{mean:.6f},{min(values)},{max(values)}\n"
    (folder / "summary.csv").write_text(summary)
    return 0


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
"""What a campaign costs a cluster, beside its peers, on fake nodes.

    python tests/bench/cluster_scale.py [--runs 1000] [--cells PATTERN] [--results FILE] [--list]

Peers execute the same pods: one bare Indexed Job (the limit of Kubernetes), one Job for each run,
and Argo Workflows. Each cell has a control plane of its own, with the controllers' default limits
unless it is called *tuned*. Write requests are counted by user from the audit log. Prints a table
of all cells and one of the goals. Cells that `--results` has are not executed again.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

from support.kube.scale_cells import CONTROLLERS, Cell, Result, measure  # noqa: E402

PACKS = (1, 20, 200)


def cells(runs: int) -> list[Cell]:
    """All cells for so many runs; the slowest last."""
    packed = [Cell(shape, runs, pack) for pack in PACKS[:0:-1] for shape in ("ours", "bare")]
    queued = [Cell("ours", runs, pack, kueue=True) for pack in PACKS[:0:-1]]
    return [
        *packed,
        *queued,
        Cell("ours", runs, behind=True),
        Cell("ours", runs, limits="tuned", failing=True),
        Cell("bare", runs, limits="tuned"),
        Cell("ours", runs, limits="tuned"),
        Cell("ours", runs, limits="tuned", kueue=True),
        Cell("jobs", runs, limits="tuned", kueue=True),
        Cell("ours", runs),
        Cell("bare", runs),
        Cell("argo", runs),
        Cell("jobs", runs),
    ]


class Table:
    """Results, found by what they measured."""

    def __init__(self, results: Iterable[Result]) -> None:
        self._results = {result.cell: result for result in results}

    def of(self, cell: Cell) -> Result | None:
        return self._results.get(cell)

    def show(self) -> None:
        print(
            "| shape | runs | by | limits | Kueue | time | pods/s | writes/pod | own/run "
            "| etcd | own object | CPU/run | memory | stale |\n" + "| --- " * 14 + "|"
        )
        for result in self._results.values():
            if not result.cell.behind:
                print(_row(result))


def _row(result: Result) -> str:
    cell = result.cell
    own = result.written(CONTROLLERS[cell.shape]) if cell.shape in CONTROLLERS else 0
    return (
        "| "
        + " | ".join(
            [
                cell.shape + (", 5 % fail" if cell.failing else ""),
                f"{cell.runs:,}",
                str(cell.pack),
                cell.limits,
                "yes" if cell.kueue else "no",
                f"{result.seconds:.1f} s",
                f"{cell.pods / result.seconds:.1f}",
                f"{result.written() / cell.pods:.2f}",
                f"{own / cell.runs:.4f}" if own else "–",
                f"{result.etcd / 1e6:.0f} MB",
                f"{result.own_object / 1e3:.1f} kB",
                f"{1000 * result.cpu / cell.runs:.2f} ms" if result.cpu else "–",
                f"{result.memory / 2**20:.0f} MiB" if result.memory else "–",
                f"{result.stale:.1f} s" if result.stale else "–",
            ]
        )
        + " |"
    )


def goals(table: Table, runs: int) -> None:
    """The goals, each with the figures that are known."""

    def told(cell: Cell, figure: Callable[[Result], float | None], form: str) -> str:
        result = table.of(cell)
        found = figure(result) if result else None
        return form.format(found) if found is not None else "–"

    def ratio(one: Cell, other: Cell) -> str:
        first, second = table.of(one), table.of(other)
        return f"{first.seconds / second.seconds:.2f}" if first and second else "–"

    ours, jobs = Cell("ours", runs), Cell("jobs", runs)
    argo, failing = Cell("argo", runs), Cell("ours", runs, limits="tuned", failing=True)
    queued = Cell("ours", runs, limits="tuned", kueue=True)
    own = CONTROLLERS["ours"]
    memory = "{:.0f} MiB"
    rows = [
        ("time, of the bare Indexed Job's", "≤ 1.05", ratio(ours, Cell("bare", runs)), "1"),
        *(
            (
                f"… packed by {pack}",
                "≤ 1.05",
                ratio(Cell("ours", runs, pack), Cell("bare", runs, pack)),
                "1",
            )
            for pack in PACKS[1:]
        ),
        ("times as fast as a Job per run", "≥ 3", ratio(jobs, ours), f"Argo {ratio(jobs, argo)}"),
        ("… packed by 20", "≥ 40", ratio(jobs, Cell("ours", runs, 20)), "–"),
        (
            "own writes per run",
            "≤ 0.05",
            told(ours, lambda r: r.written(own) / runs, "{:.4f}"),
            "Argo " + told(argo, lambda r: r.written(CONTROLLERS["argo"]) / runs, "{:.2f}"),
        ),
        (
            "all writes per pod with Kueue",
            "≤ 6.8",
            told(queued, lambda r: r.written() / runs, "{:.2f}"),
            "Job per run "
            + told(
                Cell("jobs", runs, limits="tuned", kueue=True),
                lambda r: r.written() / runs,
                "{:.2f}",
            ),
        ),
        (
            "peak memory",
            "≤ 120 MiB at 10,000, 200 at 100,000",
            told(ours, lambda r: r.memory / 2**20, memory),
            "Argo " + told(argo, lambda r: r.memory / 2**20, memory),
        ),
        (
            "CPU per run",
            "≤ 1 ms",
            told(ours, lambda r: 1000 * r.cpu / runs, "{:.2f} ms"),
            "Argo " + told(argo, lambda r: 1000 * r.cpu / runs, "{:.2f} ms"),
        ),
        (
            "own object, 5 % failed",
            "≤ 16 kB at 10,000",
            told(failing, lambda r: r.own_object / 1e3, "{:.1f} kB"),
            "Argo " + told(argo, lambda r: r.own_object / 1e3, "{:.0f} kB, none failed"),
        ),
        (
            "restart until the status is right",
            "≤ 5 s",
            told(failing, lambda r: r.restart, "{:.1f} s"),
            "–",
        ),
        (
            "20 runs behind these, until all have started",
            "≤ 30 s",
            told(Cell("ours", runs, behind=True), lambda r: r.behind, "{:.1f} s"),
            "–",
        ),
        ("writes about a finished campaign", "0", told(ours, lambda r: r.idle, "{}"), "–"),
    ]
    print("\n| goal | | ours | peer |\n| --- | --- | --- | --- |")
    for row in rows:
        print("| " + " | ".join(row) + " |")


def known(file: Path | None) -> list[Result]:
    """Results of earlier executions."""
    lines = file.read_text().splitlines() if file and file.exists() else []
    return [Result.from_json(line) for line in lines]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--cells", default="", help="a regular expression for names of cells")
    parser.add_argument("--results", type=Path, help="JSON lines, read first and added to")
    parser.add_argument("--list", action="store_true", help="print the cells' names only")
    options = parser.parse_args()
    wanted = [cell for cell in cells(options.runs) if re.search(options.cells, str(cell))]
    if options.list:
        print(*wanted, sep="\n")
        return
    results = known(options.results)
    for cell in wanted:
        if any(result.cell == cell for result in results):
            continue
        print(cell, file=sys.stderr, flush=True)
        results.append(measure(cell))
        if options.results:
            with options.results.open("a") as stream:
                stream.write(results[-1].to_json() + "\n")
    table = Table(results)
    table.show()
    goals(table, options.runs)


if __name__ == "__main__":
    main()

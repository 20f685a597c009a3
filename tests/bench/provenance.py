#!/usr/bin/env python3
"""What metadata, graph and queries cost for campaigns of 1,000, 3,000 and 10,000 runs.

    python tests/bench/provenance.py [RUNS ...] [--runs-per-configuration 10] [--rdflib]

Each size in processes of its own: wall time (and CPU time, since the machine may be shared) to
write metadata.yaml and metadata.prov.json, to load the graph, to answer the slowest query of the
package and all of them together, as CSV, each the best of three; peak memory after each. The
campaigns have floor plans, two variations, a ROS bag, a table made of it, logs and system
information for every run. Then the exponent of the power law that fits the CPU times best: 1 for a
linear cost. With `--rdflib` also plain rdflib, which takes minutes.
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.campaigns.described import make_old_campaign

Figures = dict[str, Any]


def memory() -> int:
    """Peak memory of this process so far [MiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def timed(work: Callable[[], Any]) -> tuple[list[float], Any]:
    """Wall and CPU time of some work [s], and its result."""
    begin, cpu = time.perf_counter(), time.process_time()
    result = work()
    return [time.perf_counter() - begin, time.process_time() - cpu], result


def describe(folder: Path) -> Figures:
    from robovast.analysis.provenance import describe

    spent, _ = timed(lambda: describe(folder))
    return {"build": spent, "build memory": memory()}


def query(folder: Path) -> Figures:
    from robovast.analysis.provenance.query import Graphs, query_names, read_query

    load, graphs = timed(lambda: Graphs([folder]))
    figures: Figures = {"triples": len(graphs), "load": load}
    for name in query_names():
        text = read_query(name)
        tries = [timed(lambda text=text: graphs.ask(text).csv()) for _ in range(3)]
        figures[f"? {name}"], table = min(tries)
        figures[f"# {name}"] = table.count("\n") - 1
    return {**figures, "query memory": memory()}


def rdflib(folder: Path) -> Figures:
    import rdflib

    from robovast.analysis.provenance.query import query_names, read_query

    graph = rdflib.Graph()
    figures: Figures = {}
    figures["load"], _ = timed(lambda: graph.parse(folder / "metadata.prov.json"))
    for name in query_names():
        text = read_query(name)
        figures[f"? {name}"], _ = timed(lambda text=text: list(graph.query(text)))
    return {**figures, "query memory": memory()}


STEPS = {"describe": describe, "query": query, "rdflib": rdflib}


def in_own_process(step: str, folder: Path) -> Figures:
    """Figures of one step, its memory unmixed with that of others."""
    command = [sys.executable, __file__, "--step", step, "--folder", str(folder)]
    out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    figures: Figures = json.loads(out)
    return figures


def show(runs: int, figures: Figures) -> None:
    queries = {key: value for key, value in figures.items() if key.startswith("? ")}
    slowest = max(queries, key=lambda name: queries[name])
    total = [sum(spent) for spent in zip(*queries.values(), strict=True)]
    print(f"{runs:,} runs, {figures.get('triples', 0):,} triples")
    if "build" in figures:
        print(f"  build: {spent(figures['build'])}, {figures['build memory']} MiB")
    print(f"  load: {spent(figures['load'])}")
    print(f"  slowest query: {spent(queries[slowest])} ({slowest[2:]})")
    print(
        f"  all {len(queries)} queries: {spent(total)}, {figures['query memory']} MiB", flush=True
    )


def spent(times: list[float]) -> str:
    wall, cpu = times
    return f"{wall:.3f} s (CPU {cpu:.3f} s)"


def slope(sizes: list[int], values: list[float]) -> float:
    """Exponent of the power law that fits best."""
    x, y = [math.log(size) for size in sizes], [math.log(value) for value in values]
    mean_x, mean_y = sum(x) / len(x), sum(y) / len(y)
    shared = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y, strict=True))
    return shared / sum((a - mean_x) ** 2 for a in x)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="*", type=int, default=[1000, 3000, 10000])
    parser.add_argument("--runs-per-configuration", type=int, default=10)
    parser.add_argument("--rdflib", action="store_true")
    parser.add_argument("--step", choices=list(STEPS), help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.step:
        print(json.dumps(STEPS[arguments.step](arguments.folder)))
        return
    found = []
    for runs in arguments.runs:
        with TemporaryDirectory() as results:
            each = arguments.runs_per_configuration
            folder = make_old_campaign(Path(results), runs // each, each)
            figures = in_own_process("describe", folder) | in_own_process("query", folder)
            show(runs, figures)
            if arguments.rdflib:
                print("rdflib: ", end="")
                show(runs, in_own_process("rdflib", folder))
        found.append(figures)
    for name, value in sorted(found[-1].items()):
        if name.startswith("? "):
            print(f"  {name[2:]}: {spent(value)}, {found[-1]['# ' + name[2:]]:,} rows")
    if len(found) > 1:
        for key in ("build", "load", "? test-results"):
            cpu = [figures[key][1] for figures in found]
            print(f"exponent of {key}: {slope(arguments.runs, cpu):.2f}")


if __name__ == "__main__":
    main()

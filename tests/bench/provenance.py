#!/usr/bin/env python3
"""What metadata, graph and queries cost for campaigns of 1,000, 3,000 and 10,000 runs.

    python tests/bench/provenance.py [RUNS ...] [--runs-per-configuration 10] [--rdflib]

Each size in a process of its own: seconds to write metadata.yaml and metadata.prov.json, to load
the graph, to answer the slowest query of the package and all of them together; peak memory after
each. The campaigns have floor plans, two variations, a ROS bag, a table made of it, logs and system
information for every run. Then the least squares slope between sizes, which is 1 for a linear cost.
With `--rdflib` also plain rdflib, which is patient work.
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

from provenance_campaigns import make_old_campaign


def memory() -> int:
    """Peak memory of this process so far [MiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def timed(work: Callable[[], Any]) -> tuple[float, Any]:
    begin = time.perf_counter()
    result = work()
    return time.perf_counter() - begin, result


def describe(folder: Path) -> dict[str, float]:
    from robovast.provenance import describe

    seconds, _ = timed(lambda: describe(folder))
    return {"build": seconds, "build memory": memory()}


def query(folder: Path) -> dict[str, float]:
    from robovast.provenance.query import Graphs, query_names, read_query

    load, graphs = timed(lambda: Graphs([folder]))
    figures = {"triples": len(graphs), "load": load, "load memory": memory()}
    for name in query_names():
        text = read_query(name)
        seconds, rows = timed(lambda text=text: sum(1 for _ in graphs.ask(text)))
        figures[f"? {name}"] = seconds
        figures[f"# {name}"] = rows
    return {**figures, "query memory": memory()}


def rdflib(folder: Path) -> dict[str, float]:
    import rdflib

    from robovast.provenance.query import query_names, read_query

    graph = rdflib.Graph()
    load, _ = timed(lambda: graph.parse(folder / "metadata.prov.json"))
    figures = {"load": load}
    for name in query_names():
        text = read_query(name)
        figures[f"? {name}"], _ = timed(lambda text=text: list(graph.query(text)))
    return {**figures, "query memory": memory()}


STEPS = {"describe": describe, "query": query, "rdflib": rdflib}


def in_own_process(step: str, folder: Path) -> dict[str, float]:
    """Figures of one step, its memory unmixed with that of others."""
    command = [sys.executable, __file__, "--step", step, "--folder", str(folder)]
    out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    figures: dict[str, float] = json.loads(out)
    return figures


def show(runs: int, figures: dict[str, float]) -> None:
    queries = {key[2:]: value for key, value in figures.items() if key.startswith("? ")}
    slowest = max(queries, key=queries.__getitem__)
    build = (
        f"build {figures['build']:.2f} s ({figures['build memory']} MiB), "
        if "build" in figures
        else ""
    )
    triples = f"{figures['triples']:,} triples, " if "triples" in figures else ""
    print(
        f"{runs:,} runs: {build}{triples}load {figures['load']:.2f} s, slowest query "
        f"{queries[slowest]:.3f} s ({slowest}), all {len(queries)} {sum(queries.values()):.2f} s "
        f"({figures['query memory']} MiB)",
        flush=True,
    )


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
            print(f"  {name[2:]}: {value:.3f} s, {found[-1]['# ' + name[2:]]:,} rows")
    if len(found) > 1:
        for key in ("build", "load", "build memory", "? test-results"):
            print(f"exponent of {key}: {slope(arguments.runs, [f[key] for f in found]):.2f}")


if __name__ == "__main__":
    main()

"""How soon the small maps of a large campaign are there, with the ways of its runs.

    python tests/bench/maps.py [--configurations 1000] [--runs 10] [--rows 600]

Each run has a table of poses; all configurations have one map, each a path of its own on it.
Answers are timed alone, and then in Chromium without a graphics card, from the address to the first
screen of maps and to the map of failures. Needs Debian's chromium and Playwright.
"""

# ruff: noqa: E402  # the folders of the tests are no package
from __future__ import annotations

import argparse
import math
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[1] / "testbed")]

from playwright.sync_api import sync_playwright
from robovast_testbed import debian
from support.campaigns.stored import NAME, add_map, write, write_campaign
from support.servers.page import shown

from robovast.base.serialization import dump_yaml
from robovast.evaluation.drive.maps import configuration_maps

REPEAT = 5
BESIDE = 24
"""Maps of one answer."""
HEAD = "frame,timestamp,position.x,position.y,position.z\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--configurations", type=int, default=1000)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--rows", type=int, default=600)
    options = parser.parse_args()
    debian.require("chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        results = Path(folder).resolve()
        root = campaign(results, options.configurations, options.runs, options.rows)
        names = sorted(path.name for path in root.glob("hall-*"))
        for which in (names[:BESIDE], names[-BESIDE:]):
            timed(
                f"{BESIDE} maps, from {which[0]}", partial(configuration_maps, results, NAME, which)
            )
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        with shown(results) as server:

            def open_maps(shows: str) -> None:
                page.goto("about:blank")
                page.goto(f"{server.address}#/campaign/{NAME}?view=maps")
                page.locator(shows).first.wait_for()

            timed("in the browser, small maps", partial(open_maps, ".maps canvas"))
            timed("in the browser, places of failure", partial(open_maps, ".failure-map .spot"))
            page.goto("about:blank")
        browser.close()


def campaign(results: Path, configurations: int, runs: int, rows: int) -> Path:
    variants = [{"number": number} for number in range(configurations)]
    root = write_campaign(
        results,
        variants=variants,
        runs=runs,
        judge=lambda parameters, run: "passed" if (parameters["number"] + run) % 3 else "failed",
        outputs=False,
    )
    shutil.move(add_map(root, "hall-1"), root / "_config" / "maps")
    record = {"map_file": "maps/hall.yaml", "path": [{"x": i / 10, "y": 0.0} for i in range(50)]}
    configs = [{"name": path.name, "_navigation": record} for path in sorted(root.glob("hall-*"))]
    write(root / "_transient" / "configurations.yaml", dump_yaml({"configs": configs}))
    for i, path in enumerate(sorted(root.glob("hall-*/*/"))):
        if path.name.isdecimal():
            write(path / "poses.csv", HEAD + "".join(way(i, rows)))
    return root


def way(number: int, rows: int) -> list[str]:
    places = ((5 + 3 * math.cos(i / 100 + number), 4 + 2 * math.sin(i / 90)) for i in range(rows))
    return [f"base_link,{i / 10:.9f},{x},{y},0\n" for i, (x, y) in enumerate(places)]


def timed(what: str, act: Callable[[], object]) -> None:
    times = []
    for _ in range(REPEAT):
        began, used = time.perf_counter(), time.process_time()
        act()
        times.append((time.perf_counter() - began, time.process_time() - used))
    walls, cpus = (sorted(values) for values in zip(*times, strict=True))
    middle = REPEAT // 2
    print(
        f"{what:40} {walls[middle]:.2f} s [{walls[0]:.2f}–{walls[-1]:.2f}], "
        f"CPU {cpus[middle]:.2f} s"
    )


if __name__ == "__main__":
    main()

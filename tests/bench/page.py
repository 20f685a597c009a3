"""How quick the page is with a campaign of many runs, and how much memory its server takes.

    python tests/bench/page.py [--variants 1000] [--runs 10]

Needs Debian's chromium, which the testbed installs, and Playwright.
"""

# ruff: noqa: E402  # the folders of the tests are no package
from __future__ import annotations

import argparse
import re
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[1] / "testbed")]

from playwright.sync_api import Page, sync_playwright
from robovast_testbed import debian
from support.campaigns.stored import NAME, write_campaign
from support.servers.page import shown

REPEAT = 7
AFTER = """async () => {{
  const begin = performance.now();
  {act};
  await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  return performance.now() - begin;
}}"""
CHOICES = {
    "a cell is chosen": "document.querySelector('[data-cell=\"1,1\"]').click()",
    "the table is sorted": "document.querySelectorAll('th[aria-sort] button')[2].click()",
    "the table is scrolled": "document.querySelector('.grid').scrollTop += 1e4",
    "another view is drawn": "document.querySelector('[role=tab][aria-selected=false]').click()",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--variants", type=int, default=1000)
    parser.add_argument("--runs", type=int, default=10)
    options = parser.parse_args()
    debian.require("chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        results = Path(folder)
        variants = [
            {"speed": i % 60 / 10, "width": i % 7 / 10, "map": "ab"[i % 2], "seed": i}
            for i in range(options.variants)
        ]
        print(f"writing {options.variants} x {options.runs} runs …")
        write_campaign(
            results,
            variants=variants,
            runs=options.runs,
            judge=lambda parameters, number: "failed" if parameters["speed"] > number else "passed",
            outputs=False,
        )
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox"]
        )
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        began = time.perf_counter()
        with shown(results) as server:
            line("the server answers", time.perf_counter() - began)
            measure(page, f"{server.address}#/campaign/{NAME}", "cold")
            page.goto("about:blank")
            measure(page, f"{server.address}#/campaign/{NAME}", "warm")
            for what, act in CHOICES.items():
                times = [page.evaluate(AFTER.format(act=act)) / 1000 for _ in range(REPEAT)]
                line(f"{what}, median of {REPEAT}", median(times))
            status = Path(f"/proc/{server.process.pid}/status").read_text()
            most = int(re.findall(r"VmHWM:\s+(\d+)", status)[0]) / 1000
            print(f"{'memory of the server, at most':40} {most:8.0f} MB")
            page.goto("about:blank")
        browser.close()


def measure(page: Page, address: str, which: str) -> None:
    page.goto(address)
    page.locator("tr[data-row]").first.wait_for()
    rows = page.evaluate("performance.now()") / 1000
    paint = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
    line(f"first paint, {which}", paint / 1000)
    line(f"first rows, {which}", rows)


def line(what: str, seconds: float) -> None:
    print(f"{what:40} {seconds:8.3f} s")


if __name__ == "__main__":
    main()

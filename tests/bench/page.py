"""How quick the page is with a campaign of many runs, and how much memory its server takes.

    python tests/bench/page.py [--variants 1000] [--runs 10] [--keep FOLDER]

Each cold start is a new server and a new browser's page; the least of several counts, since others
may share the machine. An interaction lasts from the event to the picture after the last change that
it makes. CPU is of the server's process, work of the page's thread. Needs Debian's chromium, which
the testbed installs, and Playwright.
"""

# ruff: noqa: E402  # the folders of the tests are no package
from __future__ import annotations

import argparse
import os
import re
import sys
import tempfile
import time
from pathlib import Path
from random import Random
from statistics import median

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[1] / "testbed")]

from playwright.sync_api import Browser, CDPSession, Page, expect, sync_playwright
from robovast_testbed import debian
from support.campaigns.stored import NAME, write_campaign
from support.servers.page import ShownPage, shown

STARTS = 4
REPEAT = 8
PAINTED = """
let seen = () => null;
for (const name of ['clearRect', 'stroke', 'fill']) {
  const { prototype } = CanvasRenderingContext2D;
  const usual = prototype[name];
  prototype[name] = function (...given) { seen(); return usual.apply(this, given); };
}
window.painted = async (act) => {
  const begin = performance.now();
  let last = 0, latest = begin, asked = false;
  const after = new MessageChannel();
  after.port1.onmessage = () => { latest = last = performance.now(); asked = false; };
  seen = () => {
    if (!asked) requestAnimationFrame(() => after.port2.postMessage(null));
    asked = true;
  };
  const observer = new MutationObserver(seen);
  observer.observe(document, {
    subtree: true, childList: true, attributes: true, characterData: true });
  await act();
  do await new Promise((done) => setTimeout(done, 50));
  while (asked || performance.now() < latest + 300);
  observer.disconnect();
  after.port1.close();
  seen = () => null;
  return last && last - begin;
};
window.pointed = (kind, share) => {
  const canvas = [...document.querySelectorAll('.parallel canvas')].at(-1);
  canvas.setPointerCapture = () => null;
  const box = canvas.getBoundingClientRect();
  const axes = document.querySelectorAll('.parallel .axis').length;
  canvas.dispatchEvent(new PointerEvent(kind, {
    bubbles: true, clientX: box.x + box.width / axes / 2, clientY: box.y + share * box.height }));
};
window.clicked = (place) => document.querySelector(place).click();
window.turn = (...given) => given[(window.turns = (window.turns ?? 0) + 1) % given.length];
window.found = (text) => {
  const field = document.querySelector('main input[type=search]');
  field.value = text;
  field.dispatchEvent(new InputEvent('input', { bubbles: true }));
};
window.axes = (names) => {
  location.hash = location.hash.split('?')[0] + '?view=parallel&axes=' + names;
};
"""
"""`painted(act)`: how long until the picture after the last change of the document or of a canvas
that an event makes [ms]; 0 if nothing changed."""
INTERACTIONS = {
    "a verdict is chosen": "clicked('[aria-label=Verdicts] button')",
    "a cause is chosen": "clicked('.failures button')",
    "a factor is chosen": "clicked(turn('.effects li:nth-child(1) button', "
    "'.effects li:nth-child(2) button'))",
    "a cell is chosen": "clicked('[data-cell=\"1,1\"]')",
    "the table is sorted by a factor": "clicked('th[aria-sort]:nth-child(4) button')",
    "the table is sorted by the duration": "[...document.querySelectorAll('th[aria-sort] button')]"
    ".find((one) => one.textContent.startsWith('Duration')).click()",
    "a condition is found": "found(turn('speed>3', 'speed>2'))",
    "a word is found": "found(turn('hall-7', 'goal', ''))",
    "the table is scrolled": "document.querySelector('.grid').scrollTop = turn(1e4, 2e4)",
    "another view is drawn": "clicked('[role=tab][aria-selected=false]')",
    "parallel coordinates are drawn": "axes(turn('p%3Aspeed,p%3Again,p%3Aseed,rate', ''))",
    "an axis is dragged along": "pointed('pointerdown', 0.5); "
    "pointed('pointermove', 0.3 + 0.1 * Math.random())",
    "lines are chosen along it": "pointed('pointerup', 0.4)",
    "the line at the pointer is shown": "pointed('pointermove', turn(0.35, 0.45))",
}
BETWEEN = {"an axis is dragged along": "lines are chosen along it"}
"""What follows an interaction at once: the end of a drag, its beginning."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--variants", type=int, default=1000)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--keep", metavar="FOLDER", type=Path, help="for the next time")
    options = parser.parse_args()
    debian.require("chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        results = options.keep or Path(folder)
        if not (results / NAME).exists():
            print(f"writing {options.variants} x {options.runs} runs …")
            write(results, options.variants, options.runs)
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox"]
        )
        runs = options.variants * options.runs
        print(f"load {os.getloadavg()[0]:.0f} on {os.cpu_count()} CPUs")
        starts = [cold_start(browser, results, runs) for _ in range(STARTS)]
        for what in starts[0]:
            all_of = [start[what] for start in starts]
            print(f"{what:40} {min(all_of):8.2f} s [{median(all_of):.2f}-{max(all_of):.2f}]")
        with shown(results) as server:
            sent(server)
            use(browser, server, runs)
        browser.close()


def write(results: Path, variants: int, runs: int) -> None:
    chance = Random(0)  # noqa: S311  # no secret
    write_campaign(
        results,
        variants=[
            {
                "speed": i % 60 / 10,
                "width": i % 7 / 10,
                "map": "ab"[i % 2],
                "seed": i,
                "gain": chance.gauss(),
            }
            for i in range(variants)
        ],
        runs=runs,
        judge=lambda parameters, number: "failed" if parameters["speed"] > number else "passed",
        outputs=False,
    )


def cold_start(browser: Browser, results: Path, runs: int) -> dict[str, float]:
    """What is there when, after the server has been started and the page opened."""
    begin = time.perf_counter()
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    try:
        with shown(results) as server:
            answers = time.perf_counter() - begin
            seen = opened(page, server, runs)
            cpu = process_cpu(server.process.pid)
            page.goto("about:blank")
            again = opened(page, server, runs)
            page.goto("about:blank")
    finally:
        page.close()
    return {
        "the server answers": answers,
        **{f"{what}, cold": seconds for what, seconds in seen.items()},
        "CPU of the server until then": cpu,
        **{f"{what}, warm": seconds for what, seconds in again.items()},
    }


def opened(page: Page, server: ShownPage, runs: int) -> dict[str, float]:
    """What is there how long after the page of the campaign was opened [s]."""
    page.goto(f"{server.address}#/campaign/{NAME}")
    page.locator("tr[data-row]").first.wait_for()
    rows = page.evaluate("performance.now()")
    told = re.compile(f"^{runs:,} runs$".replace(",", "."))
    expect(page.locator(".tools [role=status]")).to_have_text(told, timeout=60_000)
    whole = page.evaluate("performance.now()")
    page.locator("[data-cell]").first.wait_for(timeout=60_000)
    matrix = page.evaluate("performance.now()")
    paint = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
    found = {"first paint": paint, "first rows": rows, "all rows": whole, "the matrix": matrix}
    return {what: milliseconds / 1000 for what, milliseconds in found.items()}


def use(browser: Browser, server: ShownPage, runs: int) -> None:
    """Do everything that one does with a campaign, several times."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.add_init_script(PAINTED)
    opened(page, server, runs)
    work = page.context.new_cdp_session(page)
    work.send("Performance.enable", {"timeDomain": "threadTicks"})
    times: dict[str, list[tuple[float, float]]] = {}
    for what in INTERACTIONS:
        if what in BETWEEN.values():
            continue
        page.evaluate("found('')")
        for _ in range(REPEAT):
            for one in filter(None, (what, BETWEEN.get(what))):
                times.setdefault(one, []).append(timed(page, work, one))
    for what, measured in times.items():
        # Some change nothing: the pointer may stay at its line.
        seconds, worked = zip(*(pair for pair in measured if pair[0]), strict=True)
        print(
            f"{what:40} {median(seconds):8.3f} s [{min(seconds):.3f}-{max(seconds):.3f}]"
            f"   work {median(worked):.3f} s"
        )
    status = Path(f"/proc/{server.process.pid}/status").read_text()
    most = int(re.findall(r"VmHWM:\s+(\d+)", status)[0]) / 1000
    print(f"{'memory of the server, at most':40} {most:8.0f} MB")
    page.close()


def timed(page: Page, work: CDPSession, what: str) -> tuple[float, float]:
    """How long until an interaction is painted, and how much the page's thread worked [s]; 0 if
    nothing changed."""
    before = worked(work)
    painted: float = page.evaluate(f"painted(() => {{ {INTERACTIONS[what]}; }})") / 1000
    return painted, worked(work) - before


def sent(server: ShownPage) -> None:
    """What a browser receives of the program and of its data, which are sent compressed."""
    for what, path in {
        "script": "page.js",
        "style": "page.css",
        "data": f"api/campaigns/{NAME}",
    }.items():
        answer = server.get(path, **{"Accept-Encoding": "gzip"})
        encoding = answer.headers["Content-Encoding"]
        print(f"{what + f' as it is sent ({encoding})':40} {len(answer.body) / 1000:8.0f} kB")


def worked(work: CDPSession) -> float:
    """How long the page's thread has worked [s]; what others on the machine do does not count."""
    metrics = work.send("Performance.getMetrics")["metrics"]
    return next(one["value"] for one in metrics if one["name"] == "TaskDuration")


def process_cpu(process: int) -> float:
    """CPU time of a process [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()

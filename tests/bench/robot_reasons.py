#!/usr/bin/env python3
"""Whether reasons say why drives of a robot failed, and how many clicks lead to that moment.

    python tests/bench/robot_reasons.py

Executes two drives of each of five causes in the example robot_navigation: a box that the margin is
too small for, a way that boxes close, a simulator so slow that the scenario's timeout ends it, a
crash in a node, and a map that is missing. Only the crash is built in; parameters do the others.
Prints how many of the ten reasons name their cause and in how many groups they fall. Then opens the
page in Chromium, and counts the clicks from the list of campaigns until a line of the log that
names the cause is in sight, for the first run of each. Needs Debian's chromium and Playwright.
"""

# ruff: noqa: E402  # the folders of the tests are no package
from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[1] / "testbed")]

import yaml
from playwright.sync_api import Page, expect, sync_playwright
from reasons import VAST, report, stored
from robovast_testbed import debian
from support.campaigns.local import EXAMPLES, ros_environment
from support.servers.page import shown

EXAMPLE = EXAMPLES / "robot_navigation"
CRASH = 0.81
"""The speed at which the robot's simulator crashes [m/s]."""
STEP = "        self.steps += 1\n"
FAULT = f"""\
        if self.steps == 20 and abs(self.given_speed - {CRASH}) < 1e-6:
            import ctypes
            ctypes.string_at(0)
"""
PARAMETERS = {
    "collision": {"margin": 0.02},
    "closed": {"margin": 0.1},
    "slow": {"margin": 0.1, "pace": 0.01},
    "crash": {"margin": 0.02, "speed": CRASH},
    "missing": {"map_file": "maps/nowhere.yaml"},
}
CAUSES = {
    "collision": "collision",
    "closed": "no way to the goal",
    "slow": "stopped by the scenario's timeout",
    "crash": "SIGSEGV",
    "missing": "FileNotFoundError",
}
"""What the reason of each configuration must contain."""
SAID = CAUSES | {
    "collision": "collision after",
    "slow": "Cancel requested",
    "crash": "Segmentation fault",
}
"""What the line of its log must contain."""


def broken_example(folder: Path) -> Path:
    """The example with a configuration for each cause."""
    shutil.copytree(EXAMPLE, folder)
    simulator = folder / "files" / "simulator.py"
    simulator.write_text(simulator.read_text().replace(STEP, STEP + FAULT, 1))
    navigate = folder / "files" / "navigate.py"
    begin = "    if lack:\n"
    speed = '    simulator.given_speed = float(given["speed"])\n'
    navigate.write_text(navigate.read_text().replace(begin, speed + begin, 1))
    document = yaml.safe_load((folder / "robot_navigation.vast").read_text())
    (drive,) = document["configuration"]
    floorplan, path, obstacles, _ = drive["variations"]
    floorplan["FloorplanGeneration"]["floorplans"] = ["plans/flat.fpm"]
    path["PathVariationRandom"]["num_paths"] = 1
    obstacles["ObstacleVariation"]["obstacle_configs"][0]["amount_per_m"] = [1.0]
    document["configuration"] = [
        {
            "name": name,
            "variations": [floorplan, path, obstacles]
            + [{"ParameterVariationList": {"name": k, "values": [v]}} for k, v in own.items()],
        }
        for name, own in PARAMETERS.items()
    ]
    document["execution"]["runs"] = 2
    file = folder / "causes.vast"
    file.write_text(json.dumps(document))
    return file


def main() -> None:
    debian.require("chromium")
    with TemporaryDirectory() as folder:
        out = Path(folder) / "results"
        command = [VAST, "-V", broken_example(Path(folder) / "example"), "exec", "local", "run"]
        subprocess.run(
            [*command, "--runtime", "process", "-o", out],
            env={**os.environ, "ROBOVAST_PROCESS_ENV": ros_environment()},
            capture_output=True,
            check=False,
        )
        report(stored(out), CAUSES)
        for name, (clicks, line) in seen(out).items():
            sys.stdout.write(f"{clicks} clicks to a line of {name}: {line}\n")


def seen(results: Path) -> dict[str, tuple[int, str]]:
    """For each cause the clicks from the list of campaigns to its line in a log, and that line."""
    with sync_playwright() as playwright, shown(results) as server:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox"]
        )
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        found = {name: clicked(page, server.address, name) for name in CAUSES}
        browser.close()
    return found


def clicked(page: Page, address: str, name: str) -> tuple[int, str]:
    """Clicks until a line is in sight that says why a run of this configuration failed."""
    page.goto(address)
    clicks = [
        page.get_by_role("link", name="robot-navigation"),
        page.locator("tr[data-row]").filter(has_text=name).get_by_role("link"),
    ]
    for place in clicks:
        place.first.click()
    lines = page.get_by_role("region", name="Lines of the log").get_by_role("listitem")
    line = lines.filter(has_text=SAID[name]).first
    expect(line).to_be_in_viewport(timeout=30_000)
    return len(clicks), line.inner_text().replace("\n", " ")[:100]


if __name__ == "__main__":
    main()

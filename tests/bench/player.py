"""How soon the player shows a large bag, how smoothly it plays, and what its server needs.

    python tests/bench/player.py [--megabytes 500] [--seconds 600] [--compress]

Writes a bag of odometry, transforms, scans and camera pictures of random bytes. Needs Debian's
chromium, which the testbed installs, and Playwright; it draws without a graphics card.
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

import numpy as np
from playwright.sync_api import Page, sync_playwright
from robovast_testbed import debian
from rosbags.rosbag2 import CompressionMode
from support.campaigns.drives import DriveBag, around
from support.campaigns.stored import NAME, add_map, write_campaign
from support.servers.page import ShownPage, shown

RATES = {"odometry": 50, "scan": 10, "picture": 5}
"""[1/s]"""
FRAMES = """async () => {
  const times = [];
  const begin = performance.now();
  while (performance.now() - begin < 3000) {
    times.push(await new Promise((done) => requestAnimationFrame(done)));
  }
  return times.slice(1).map((time, i) => time - times[i]);
}"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--megabytes", type=int, default=500)
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--compress", action="store_true", help="compress the bag's chunks (zstd)")
    options = parser.parse_args()
    debian.require("chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        results = Path(folder)
        root = write_campaign(results, outputs=False)
        add_map(root, "hall-1")
        bag = root / "hall-1" / "0" / "rosbag2"
        compression = CompressionMode.STORAGE if options.compress else None
        write_bag(bag, options.megabytes, options.seconds, compression)
        size = sum(path.stat().st_size for path in bag.iterdir())
        print(f"a bag of {size / 1e6:.0f} MB, {options.seconds} s")
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        address = f"#/campaign/{NAME}/hall-1/0?tab=player"
        with shown(results) as server:
            page.goto(server.address)  # the browser has started
            first_frame(page, f"{server.address}{address}&t=1", "first frame, cold")
            page.goto("about:blank")
            middle = options.seconds // 2
            first_frame(page, f"{server.address}{address}&t={middle}", "first frame in the middle")
            page.get_by_role("region", name="Playback").focus()
            page.keyboard.press("Space")
            frames("while parts are read", page)
            page.locator(".marks[data-complete]").wait_for(timeout=120_000)
            line("all parts are there after", page.evaluate("performance.now()") / 1000)
            frames("afterwards", page)
            page.keyboard.press("f")
            frames("while the picture follows the robot", page)
            memory(server)
            page.goto("about:blank")
        browser.close()


def write_bag(
    folder: Path, megabytes: int, seconds: int, compression: CompressionMode | None
) -> None:
    chance = np.random.default_rng(1)
    with DriveBag(folder, compression=compression) as bag:
        bag.transforms([bag.transform("base_link", "laser", 0.0, (0.1, 0.0, 0.2))], static=True)
        size = megabytes * 1_000_000 // (seconds * RATES["picture"])
        for tick in range(seconds * RATES["odometry"]):
            at = tick / RATES["odometry"]
            bag.odometry(at, *around(at))
            if tick % (RATES["odometry"] // RATES["scan"]) == 0:
                bag.transforms([bag.transform("map", "odom", at, (1.0, 0.0, 0.0))])
                bag.scan(at, [2.5] * 360)
            if tick % (RATES["odometry"] // RATES["picture"]) == 0:
                bag.write_raw("/camera", "sensor_msgs/msg/CompressedImage", chance.bytes(size), at)
            if tick % (10 * RATES["odometry"]) == 0:
                bag.say(at, 20, "on the way")


def first_frame(page: Page, address: str, which: str) -> None:
    began = time.perf_counter()
    page.goto(address)
    page.locator(".where", has_text="x ").wait_for()
    line(which, time.perf_counter() - began)


def frames(which: str, page: Page) -> None:
    """Frames a second: by the median, and by the slowest of twenty."""
    times = sorted(page.evaluate(FRAMES))
    slow = times[len(times) * 19 // 20]
    print(f"frames a second {which:24} {1000 / median(times):8.0f}, 95 % above {1000 / slow:.0f}")


def memory(server: ShownPage) -> None:
    status = Path(f"/proc/{server.process.pid}/status").read_text()
    most = int(re.findall(r"VmHWM:\s+(\d+)", status)[0]) / 1000
    print(f"{'memory of the server, at most':40} {most:8.0f} MB")


def line(what: str, seconds: float) -> None:
    print(f"{what:40} {seconds:8.3f} s")


if __name__ == "__main__":
    main()

"""The page in a real browser: with keys or mouse, on any screen, of a good or a bad folder."""

from __future__ import annotations

import fcntl
import io
import json
import random
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest
from PIL import Image
from playwright.sync_api import Browser, Page, expect, sync_playwright
from robovast_testbed import debian
from support.campaigns.drives import DriveBag, photo, record_drive
from support.campaigns.local import make_campaign
from support.campaigns.searches import QD, write_search
from support.campaigns.stored import (
    NAME,
    START,
    SYSTEM_LOG,
    add_map,
    write,
    write_campaign,
    write_run,
)
from support.patience import PATIENCE, eventually
from support.servers.page import VAST, ShownPage, shown

WEB = Path(__file__).parents[2] / "web"
LATER = "hall-2026-03-05-090000"
SHAPES = "shapes-2026-03-06-090000"
LIMITS, WAYS = "limits-2026-03-07-090000", "ways-2026-03-07-100000"
LAST, NIGHT = "hall-2026-03-06-090000", "night-2026-03-08-090000"
ONE, BROKEN = "one-2026-03-08-100000", "broken-2026-03-08-110000"
POSE = {"position": {"x": 3.925, "y": -3.175}, "orientation": {"roll": 0, "yaw": 1.6092}}
EVIL = "<img src=x onerror=stolen=1>"

VARIANTS = [
    {"speed": speed, "width": width, "map": place}
    for speed in (0.5, 1.0, 2.0)
    for width in (0.8, 1.2)
    for place in ("hall", "office")
]
SCREENS = {
    "campaigns": "#/",
    "matrix": f"#/campaign/{NAME}",
    "measure": f"#/campaign/{NAME}?x=map&y=speed&colour=duration&cell=1,1",
    "parallel": f"#/campaign/{NAME}?view=parallel&q=speed>0.5",
    "mixed": f"#/campaign/{NAME}?view=mixed",
    "document": f"#/campaign/{NAME}?view=sources",
    "search": f"#/campaign/{LIMITS}",
    "search unsure": f"#/campaign/{LIMITS}?across=load&down=surface&shade=unsure",
    "archive": f"#/campaign/{WAYS}?view=search",
    "maps": f"#/campaign/{NAME}?view=maps",
    "logs": f"#/campaign/{NAME}?view=logs&text=goal+not+reached",
    "log": f"#/campaign/{NAME}/hall-9/0",
    "plots": f"#/campaign/{NAME}/hall-9/0?tab=plots",
    "siblings": f"#/campaign/{NAME}/hall-9/0?tab=plots&everyone=1",
    "resources": f"#/campaign/{NAME}/hall-9/0?tab=resources",
    "parameters": f"#/campaign/{NAME}/hall-9/0?tab=parameters",
    "pictures": f"#/campaign/{NAME}/hall-9/0?tab=video",
    "bag": f"#/campaign/{NAME}/hall-9/0?tab=bag",
    "player": f"#/campaign/{NAME}/hall-9/0?tab=player&t=5",
    "two runs": f"#/campaign/{NAME}/hall-9/0?tab=player&with=hall-9%2F1&show=apart&everyone=1",
    "map": f"#/campaign/{NAME}/hall-9/0?tab=map",
    "history": f"#/campaign/{NAME}/hall-9/0?tab=history",
    "files": f"#/campaign/{NAME}/hall-9/0?tab=files",
    "notebooks": f"#/campaign/{NAME}/hall-9/0?tab=notebooks",
    "job": f"#/job/{NAME}/job-0",
    "structures": f"#/campaign/{SHAPES}",
    "lines": f"#/campaign/{SHAPES}?view=parallel",
    "structure": f"#/campaign/{SHAPES}/hall-1/0?tab=parameters",
    "compare": f"#/compare?a={NAME}&b={LATER}",
    "several": f"#/compare?a={NAME}&b={LATER},{LAST}",
    "none after": f"#/compare?a={NAME}",
    "under way": f"#/campaign/{NIGHT}",
    "under way, lines": f"#/campaign/{NIGHT}?view=parallel",
    "under way, maps": f"#/campaign/{NIGHT}?view=maps",
    "under way, a run": f"#/campaign/{NIGHT}/hall-1/0",
    "under way, a job": f"#/job/{NIGHT}/job-7",
    "one configuration": f"#/campaign/{ONE}",
    "one configuration, maps": f"#/campaign/{ONE}?view=maps",
    "broken": f"#/campaign/{BROKEN}",
    "broken run": f"#/campaign/{BROKEN}/hall-1/0",
    "broken drive": f"#/campaign/{BROKEN}/hall-1/0?tab=player",
    "broken plots": f"#/campaign/{BROKEN}/hall-1/0?tab=plots",
    "broken parameters": f"#/campaign/{BROKEN}/hall-1/0?tab=parameters",
    "start": "#/start",
    "nothing": "#/campaign/none",
    "nowhere": "#/campain/none",
}
PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010802000000907753de"
    "0000000c49444154789c63606060000000040001f61738550000000049454e44ae426082"
)
BAG = """\
rosbag2_bagfile_information:
  duration: {nanoseconds: 9500000000}
  starting_time: {nanoseconds_since_epoch: 1772630684000000000}
  topics_with_message_count:
  - topic_metadata: {name: /scan, type: sensor_msgs/msg/LaserScan}
    message_count: 95
"""


def judge(seed: int, share: float):
    chance = random.Random(seed)  # noqa: S311  # no secret

    def verdict(parameters, number) -> str:
        if parameters["speed"] == 2 and number == 0:
            return "failed"
        return "errored" if chance.random() < share else "passed"

    return verdict


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("browsed") / "results"
    root = write_campaign(folder, variants=VARIANTS, runs=4, judge=judge(1, 0.1))
    write_campaign(folder, LATER, variants=VARIANTS, runs=4, judge=judge(2, 0.5), outputs=False)
    shapes = [{"start": POSE, "obstacles": [POSE] * n, "a" * 40: "b" * 60} for n in (1, 2)]
    write_campaign(folder, SHAPES, variants=shapes, judge=lambda *_: "failed")
    write_campaign(folder, LAST, variants=VARIANTS, runs=4, judge=judge(3, 0.1), outputs=False)
    write_search(folder, LIMITS)
    write_search(folder, WAYS, batches=2, **QD)
    night = write_campaign(folder, NIGHT, runs=3, judge=judge(4, 0.5))
    shutil.rmtree(night / "hall-2" / "2")
    write(night / ".running" / "lock", "")
    write(night / ".running" / "job-7" / "console.log", "[INFO] [1772630684.0] [n]: begins\n")
    write_campaign(folder, ONE, variants=[{}], runs=3)
    write_broken(folder)
    run = root / "hall-9" / "0"
    for number in ("0", "1"):
        record_drive(root / "hall-9" / number / "rosbag2", pictures=number == "0")
    add_map(root, "hall-9")
    (run / "camera.png").write_bytes(PIXEL)
    return folder


def write_broken(folder: Path) -> None:
    """A campaign of which no file is as it should be."""
    root = write_campaign(folder, BROKEN, judge=lambda *_: "failed")
    for place in (
        "_config/hall.vast",
        "_execution/execution.yaml",
        "_transient/configurations.yaml",
    ):
        write(root / place, "[: {")
    run = root / "hall-1" / "0"
    for name, text in {"run.json": "{", "test.xml": "<testsuite", "poses.csv": "a,b\n1\n"}.items():
        write(run / name, text)
    write(run / "rosbag2" / "metadata.yaml", "[")
    write(run / "rosbag2" / "rosbag2_0.mcap", "no bag")
    (root / "_jobs" / "job-0" / "logs" / "system.log").write_bytes(b"\xff\xfe\x00 no text\n")


@pytest.fixture(scope="module")
def server(results: Path) -> Iterator[ShownPage]:
    with open(results / NIGHT / ".running" / "lock") as lock, shown(results) as page:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield page


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    debian.require("chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox"]
        )
        yield browser
        browser.close()


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A tab of 1280 × 800; no complaint may appear in its console."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    page = context.new_page()
    page.set_default_timeout(1000 * PATIENCE)
    expect.set_options(timeout=1000 * PATIENCE)
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(f"{message.type}: {message.text}"))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("dialog", lambda dialog: complaints.append(dialog.message))
    yield page
    context.close()
    assert [one for one in complaints if "404 (Not Found)" not in one] == []


@pytest.fixture(scope="module")
def axe() -> str:
    """The accessibility checks, as the front end's lock file pins them."""
    script = WEB / "node_modules" / "axe-core" / "axe.min.js"
    if not script.exists():
        subprocess.run(["npm", "ci", "--silent", "--ignore-scripts"], cwd=WEB, check=True)
    return script.read_text(encoding="utf-8")


DRAWN = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
"""Ends when what came before it is drawn."""


def settled(page: Page) -> None:
    for _ in range(2):  # what an answer brought may ask for more
        page.evaluate(DRAWN)
        expect(page.locator(".loading")).to_have_count(0)
    page.wait_for_timeout(100)
    page.evaluate(DRAWN)


@contextmanager
def browsing(
    page: Page, results: Path, *options: str | Path, cwd: Path | None = None
) -> Iterator[str]:
    """Address of the page of a folder; the tab leaves before the server does."""
    with shown(results, *options, cwd=cwd) as server:
        yield server.address
        page.goto("about:blank")


def test_three_clicks_from_a_local_run_to_the_log_of_the_failing_one(
    page: Page, tmp_path: Path
) -> None:
    file = make_campaign(tmp_path / "in", 'echo "no goal for $1"; [ "$1" != 2 ]\n')
    command = [VAST, "-V", file, "exec", "local", "run", tmp_path / "out", "--runtime", "process"]
    assert subprocess.run(command, capture_output=True).returncode == 1
    with browsing(page, tmp_path / "out") as address:
        page.goto(address)
        page.get_by_role("link", name="test-campaign").click()
        page.locator("tr[data-row]").first.get_by_role("link").click()
        expect(page.get_by_role("heading", level=1)).to_have_text(re.compile("one-2/0 .*failed"))
        lines = page.get_by_role("region", name="Lines of the log")
        expect(lines).to_contain_text("no goal for 2")
        again = page.get_by_label("Reproduce on this machine").inner_text()
        more = page.get_by_label("Run 10 more on this machine").inner_text()
        assert more.endswith("--config=one-2 --runs=11")
    words = [str(VAST), *shlex.split(again)[1:]]
    repeated = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert "same verdict (failed)" in repeated.stdout


def test_a_cell_has_the_command_that_runs_its_configurations_more_often(
    page: Page, axe: str, tmp_path: Path
) -> None:
    values = [{"speed": speed, "map": name} for speed in (1.0, 2.0) for name in "ab"]
    root = write_campaign(tmp_path, variants=values, runs=3, judge=lambda *_: "failed")
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/campaign/{NAME}?x=speed&y=-")
        page.locator('[data-cell="1,0"]').click()
        page.get_by_label("Total runs of each of 2 configurations").fill("7")
        page.keyboard.press("Enter")
        expect(page.locator(".beside")).not_to_contain_text("all intervals are wider")
        expect(page.locator(".run-more")).to_contain_text("widens the intervals of all")
        command = page.get_by_label("Run 4 more on this machine")
        expect(command).to_contain_text(f"--resume={root} --config=hall-3 --config=hall-4 --runs=7")
        page.evaluate(axe)
        found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
        assert [(v["id"], v["nodes"][0]["html"]) for v in found["violations"]] == []
        page.screenshot(path=tmp_path / "more.png", full_page=True)
        record = root / "_execution" / "execution.yaml"
        record.write_text(f"{record.read_text()}more_runs: {{hall-3: 4}}\nruns_added: true\n")
        write_run(root, "hall-3", 3, 12, values[2], lambda *_: "failed")
        expect(page.locator(".beside")).to_contain_text(
            "Runs were added after the verdicts were visible"
        )
        expect(page.locator(".run-more")).not_to_contain_text("widens the intervals of all")
        page.screenshot(path=tmp_path / "wider.png", full_page=True)


def test_a_cell_of_a_campaign_of_a_cluster_has_the_command_of_the_cluster(
    page: Page, tmp_path: Path
) -> None:
    values = [{"speed": speed, "map": name} for speed in (1.0, 2.0) for name in "ab"]
    root = write_campaign(tmp_path, variants=values, runs=3, judge=lambda *_: "failed")
    record = root / "_execution" / "execution.yaml"
    record.write_text(record.read_text().replace("local", "cluster"))
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/campaign/{NAME}?x=speed&y=-")
        page.locator('[data-cell="1,0"]').click()
        page.get_by_label("Total runs of each of 2 configurations").fill("7")
        page.keyboard.press("Enter")
        command = page.get_by_label("Run 4 more in the cluster")
        expect(command).to_contain_text('"name": "hall-3-more"')
        expect(command).to_contain_text('"parameters": [{"speed": 2.0}, {"map": "b"}], "runs": 4}')
        expect(page.get_by_role("button", name="Run 4 more")).to_have_count(0)


def test_more_runs_are_seen_and_stopped_where_they_were_started(
    page: Page, axe: str, tmp_path: Path
) -> None:
    """In a folder where no campaign can be started, since there are two documents."""
    file = make_campaign(tmp_path, 'sleep "$(cat "${0%/*}/pause")"\n')
    pause, results = file.parent / "files" / "pause", tmp_path / "results"
    pause.write_text("0")
    command = [VAST, "-V", file, "exec", "local", "run", "--runtime=process", "-c", "one-1"]
    subprocess.run([*command, results], check=True, capture_output=True)
    shutil.copy(file, tmp_path / "other.vast")
    (root,) = results.glob("test-campaign-*")
    (root / "_config" / "files" / "pause").write_text("600")
    with browsing(page, results, cwd=tmp_path) as address:
        page.goto(f"{address}#/campaign/{root.name}/one-1/0")
        page.get_by_label("Total runs").fill("4")
        page.keyboard.press("Enter")
        page.get_by_role("button", name="Run 3 more").click()
        expect(page.get_by_role("heading", level=1)).to_contain_text("one-1/0")
        launched = page.get_by_role("region", name="Campaign started here")
        expect(launched).to_contain_text("Running.")
        expect(launched).to_be_in_viewport()
        expect(launched).to_contain_text("3 pending")
        expect(launched.get_by_role("region", name="Output")).to_contain_text(
            "4 runs, 1 already finished"
        )
        expect(page.get_by_label("Run 10 more on this machine")).to_contain_text("--runs=14")
        page.screenshot(path=tmp_path / "further.png", full_page=True)
        page.evaluate(axe)
        found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
        assert [(v["id"], v["nodes"][0]["html"]) for v in found["violations"]] == []
        page.get_by_role("link", name="a campaign is running").click()
        expect(page.get_by_role("heading", level=1)).to_contain_text(root.name)
        expect(launched).to_contain_text("Running.")
        page.goto(f"{address}#/start")
        expect(page.locator(".hint").first).to_contain_text("several .vast files")
        launched.get_by_role("button", name="Stop").click()
        expect(launched).to_contain_text("Stopped.")


def test_a_campaign_is_run_from_the_page_and_looked_at(
    page: Page, axe: str, tmp_path: Path
) -> None:
    file = make_campaign(tmp_path, 'echo "no goal for $1"; [ "$1" != 2 ]\n')
    results = tmp_path / "results"
    results.mkdir()
    with browsing(page, results, "-o", file) as address:
        page.goto(address)
        page.get_by_role("link", name="Run a campaign").click()
        expect(page.locator("tr[data-row]")).to_have_count(3)
        page.get_by_label("Configurations").first.fill("one-[23]")
        expect(page.locator("tr[data-row]")).to_have_count(2)
        page.get_by_label("Runtime").select_option("process")
        page.get_by_role("button", name="Run", exact=True).click()
        launched = page.get_by_role("region", name="Campaign started here")
        expect(launched).to_contain_text("At least one run failed.")
        expect(launched.get_by_role("region", name="Output")).to_contain_text("1 failed")
        page.reload()
        expect(launched).to_contain_text("At least one run failed.")
        page.screenshot(path=tmp_path / "start.png", full_page=True)
        page.evaluate(axe)
        found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
        assert [(v["id"], v["nodes"][0]["html"]) for v in found["violations"]] == []
        page.get_by_role("link", name="Show the runs").click()
        page.locator("tr[data-row]").first.get_by_role("link").click()
        expect(page.get_by_role("region", name="Lines of the log")).to_contain_text("no goal for 2")
        page.get_by_role("button", name="Reproduce").click()
        expect(page.get_by_role("heading", level=1)).to_contain_text("one-2/0")
        expect(launched).to_contain_text("The verdict was reproduced.")
        compared = launched.get_by_label("Comparison with the original")
        expect(compared).to_contain_text("same verdict (failed)")
        launched.get_by_role("link", name="Show the run").click()
        expect(page).to_have_url(re.compile("#/campaign/test-campaign-replay-.*/one-2/0"))
        again = page.get_by_label("Comparison with the original")
        expect(again).to_contain_text("same verdict (failed)")
        again.get_by_role("link").click()
        expect(page).to_have_url(re.compile(r"#/campaign/test-campaign-\d[^/]*/one-2/0"))
        launched.get_by_role("button", name="Dismiss").click()
        expect(launched).to_have_count(0)
        page.reload()
        expect(page.get_by_role("heading", level=1)).to_contain_text("one-2/0")
        settled(page)
        expect(launched).to_have_count(0)
    assert len(list(results.glob("test-campaign-*/one-2/0/run.json"))) == 2


def test_a_replay_that_cannot_be_started_says_why_on_the_page(page: Page, tmp_path: Path) -> None:
    root = write_campaign(tmp_path, judge=lambda *_: "failed")
    write(root / "_transient" / "configurations.yaml", "[: {")
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/campaign/{NAME}/hall-1/0")
        page.get_by_role("button", name="Reproduce").click()
        launched = page.get_by_role("region", name="Campaign started here")
        expect(launched.get_by_role("alert")).to_contain_text("configurations.yaml")
        expect(launched).to_contain_text("An input is invalid.")


def test_a_run_that_is_reproduced_is_the_one_that_is_shown(page: Page, tmp_path: Path) -> None:
    """Not the first run of its configuration, whose seed ends otherwise."""
    script = 'echo "$ROBOVAST_SEED" > "$3/seed.csv"; exit $((ROBOVAST_SEED % 2))\n'
    file = make_campaign(tmp_path, script, "  seed: 7\n")
    results = tmp_path / "results"
    command = [VAST, "-V", file, "exec", "local", "run", "--runtime=process", "-c", "one-1"]
    subprocess.run([*command, "--runs=8", results], check=False, capture_output=True)
    (root,) = results.glob("test-campaign-*")
    records = [json.loads((root / f"one-1/{n}/run.json").read_text()) for n in range(8)]
    other = next(r for r in records if r["verdict"] != records[0]["verdict"])
    with browsing(page, results) as address:
        page.goto(f"{address}#/campaign/{root.name}/one-1/{other['run']}")
        expect(page.get_by_label("Reproduce on this machine")).to_contain_text("vast replay ")
        page.get_by_role("button", name="Reproduce").click()
        compared = page.get_by_label("Comparison with the original")
        expect(compared).to_contain_text(f"(seed {other['seed']}): same verdict")
        expect(compared).to_contain_text("same seed.csv")


def test_a_run_and_its_launch_follow_their_own_campaign(page: Page, tmp_path: Path) -> None:
    """A newer campaign, which postprocessing names as well, lends neither name nor verdicts."""
    file = make_campaign(tmp_path, 'printf "a\\n1\\n" > "$3/n.csv"; [ "$1" != 2 ]\n')
    results = tmp_path / "results"
    command = [VAST, "-V", file, "exec", "local", "run", "--runtime=process"]
    for chosen in ("one-1", "one-2"):
        subprocess.run([*command, "-c", chosen, results], check=False, capture_output=True)
    first = min(path.name for path in results.iterdir())
    with shown(results, postprocess=True, cwd=tmp_path) as server:
        page.goto(f"{server.address}#/campaign/{first}/one-1/0")
        page.get_by_label("Total runs").fill("3")
        page.keyboard.press("Enter")
        page.get_by_role("button", name="Run 2 more").click()
        launched = page.get_by_role("region", name="Campaign started here")
        expect(launched).to_contain_text("All runs passed.")
        expect(launched.get_by_role("heading")).to_have_text("Additional runs ")
        expect(launched).to_contain_text("3 passed")
        siblings = page.get_by_role("navigation", name="Runs of this configuration")
        expect(siblings.get_by_role("link")).to_have_count(3)  # without a reload
        page.goto("about:blank")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_screen_is_accessible_and_fits(
    page: Page, server: ShownPage, axe: str, scheme: str, tmp_path: Path
) -> None:
    page.emulate_media(color_scheme=scheme)
    for name, place in SCREENS.items():
        page.goto(server.address + place)
        settled(page)
        page.screenshot(path=tmp_path / f"{name}.png")
        page.evaluate(axe)
        found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
        assert [(v["id"], v["nodes"][0]["html"]) for v in found["violations"]] == [], name


def test_a_report_to_send_is_accessible_and_fits(
    browser: Browser, results: Path, axe: str, tmp_path: Path
) -> None:
    file, base = tmp_path / "report.html", results / LATER
    subprocess.run([VAST, "results", "report", results / NAME, "-b", base, "-o", file], check=True)
    for width in (390, 1280):
        for scheme in ("light", "dark"):
            context = browser.new_context(
                viewport={"width": width, "height": 800},
                color_scheme=scheme,  # type: ignore[arg-type]
                bypass_csp=True,  # it allows no script, and thus no checks either
            )
            page = context.new_page()
            requested: list[str] = []
            page.on("request", lambda request, seen=requested: seen.append(request.url))
            page.goto(file.as_uri())
            page.evaluate(axe)
            assert page.evaluate("axe.run()")["violations"] == []
            assert page.evaluate("document.documentElement.scrollWidth") == width
            assert [one for one in requested if not one.startswith(("file:", "data:"))] == []
            context.close()


def test_a_wide_matrix_fits_a_printed_page(browser: Browser, tmp_path: Path) -> None:
    """Of A4, with margins of 14 mm."""
    variants = [{"speed": speed, "width": w} for speed in range(24) for w in (1, 2)]
    root = write_campaign(tmp_path / "results", variants=variants, judge=judge(1, 0.5))
    subprocess.run([VAST, "results", "report", root, "-o", tmp_path / "report.html"], check=True)
    page = browser.new_page(viewport={"width": 688, "height": 1017})
    page.goto((tmp_path / "report.html").as_uri())
    page.emulate_media(media="print")
    assert page.locator(".matrix thead th").count() == 24
    assert page.evaluate("document.documentElement.scrollWidth") == 688
    page.close()


@pytest.mark.parametrize("width", [360, 390])
def test_nothing_is_wider_than_a_telephone(
    page: Page, server: ShownPage, width: int, tmp_path: Path
) -> None:
    page.set_viewport_size({"width": width, "height": 740})
    for name, place in SCREENS.items():
        page.goto(server.address + place)
        settled(page)
        page.screenshot(path=tmp_path / f"{name}.png")
        assert page.evaluate("document.documentElement.scrollWidth") <= width, name
        for tab in page.locator('[role="tab"][aria-selected="true"]').all():
            expect(tab).to_be_in_viewport(ratio=0.95)


def test_a_log_is_on_the_first_screen_of_a_telephone(page: Page, server: ShownPage) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    page.goto(f"{server.address}#/campaign/{NAME}/hall-9/0")
    wrong = page.get_by_role("region", name="Lines of the log").get_by_text("goal not reached")
    expect(wrong).to_be_in_viewport(ratio=0.95)
    expect(page.get_by_text("Reproduce on this machine")).to_be_hidden()
    page.get_by_text("Run details").click()
    expect(page.get_by_text("Reproduce on this machine")).to_be_visible()


def test_a_cell_and_a_filter_choose_runs_and_the_address_says_so(
    page: Page, server: ShownPage, browser: Browser
) -> None:
    page.goto(f"{server.address}#/campaign/{NAME}?x=speed&y=width")
    page.get_by_role("button", name=re.compile("^2, 1.2:")).click()
    expect(page.get_by_role("main").get_by_role("status")).to_have_text("8 of 48 runs")
    page.get_by_label("Filter").fill("map=hall")
    expect(page.get_by_role("main").get_by_role("status")).to_have_text("4 of 48 runs")
    page.get_by_role("button", name=re.compile("Duration")).click()
    expect(page).to_have_url(re.compile("[?&]sort="))
    shared = browser.new_page()
    shared.goto(page.url)
    expect(shared.get_by_role("main").get_by_role("status")).to_have_text("4 of 48 runs")
    expect(shared.get_by_role("columnheader", name="Duration")).to_have_attribute(
        "aria-sort", "ascending"
    )
    texts = shared.locator("tr[data-row]").all_inner_texts()
    assert texts == page.locator("tr[data-row]").all_inner_texts()
    shared.close()


def test_the_first_runs_are_there_while_others_are_read(page: Page, server: ShownPage) -> None:
    whole, held = server.get(f"api/campaigns/{NAME}").data, []
    page.route(f"**/campaigns/{NAME}", lambda route: held.append(route))
    page.route("**/begun", lambda route: route.fulfill(json={**whole, "reading": [3, 12]}))
    page.goto(f"{server.address}#/campaign/{NAME}")
    expect(page.locator("tr[data-row]").first).to_be_visible()
    title = page.get_by_role("heading", level=1)
    expect(title).to_contain_text("3 of 12 configurations read")
    expect(page.locator("[data-cell]")).to_have_count(0)
    held[0].continue_()
    expect(title).to_contain_text("incomplete" if whole["resume"] else "finished")
    expect(page.locator("[data-cell]").first).to_be_visible()


def test_a_cause_filters_everything_and_a_verdict_no_rate(page: Page, tmp_path: Path) -> None:
    """Two causes: of 4 runs at speed 2, and of one that crashed."""
    variants = [{"speed": speed, "map": place} for speed in (1.0, 2.0) for place in ("a", "b")]
    root = write_campaign(tmp_path, variants=variants, runs=4, judge=judge(1, 0), outputs=False)
    for name in ("hall-3", "hall-4"):
        write_run(root, name, 1, 1, {}, lambda *_: "failed", outputs=False)
    crashed = root / "hall-1" / "0" / "run.json"
    record = {**json.loads(crashed.read_text()), "verdict": "errored", "reason": "SIGSEGV"}
    crashed.write_text(json.dumps(record))
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/campaign/{NAME}")
        status = page.get_by_role("main").get_by_role("status")
        cells = page.get_by_role("region", name="Matrix of configurations").get_by_role("button")
        shares = ["1/4", "2/4", "0/4", "2/4"]
        expect(cells.locator("small")).to_have_text(shares)
        intervals = ["4.6 – 70 %", "15 – 85 %", "0 – 49 %", "15 – 85 %"]
        expect(cells.locator(".sure")).to_have_text(intervals)
        for chip in page.get_by_role("group", name="Verdicts").get_by_role("button").all():
            chip.click()
            expect(status).to_contain_text(" of 16 runs")
            expect(cells.locator("small")).to_have_text(shares)
            chip.click()
        page.get_by_label("Filter").fill("failed")
        expect(status).to_have_text("4 of 16 runs")
        expect(cells.locator("small")).to_have_text(shares)
        page.get_by_label("Filter").fill("")
        causes = page.get_by_role("region", name="Causes of unsuccessful runs").get_by_role(
            "button"
        )
        expect(causes).to_have_count(2)
        expect(causes.first).to_contain_text("speed = 2")
        causes.last.click()
        expect(status).to_have_text("1 of 16 runs")
        expect(cells.locator("small")).to_have_text(["1/4", "0/4", "0/4", "0/4"])
        page.reload()
        expect(causes.last).to_have_attribute("aria-pressed", "true")
        page.get_by_role("button", name="Only the selected cause").click()
        expect(status).to_have_text("16 runs")


def test_the_matrix_begins_with_what_was_varied_and_matters(page: Page, tmp_path: Path) -> None:
    """Not with the files and poses that came of it."""
    variants = [
        {"map_file": f"{plan}.yaml", "mesh_file": f"{plan}.stl", "pose": {"x": path}, "margin": m}
        for plan in ("depot", "flat")
        for path in range(3)
        for m in (0.02, 0.1)
    ]

    def factors(parameters):
        plan, margin = parameters["map_file"].partition(".")[0], parameters["margin"]
        path = {"path": {"value": str(parameters["pose"]["x"])}}
        return {"floor_plan": {"value": plan}, **path, "margin": {"value": margin, "unit": "m"}}

    def fails(parameters, number):
        return "failed" if parameters["margin"] < 0.05 and number else "passed"

    write_campaign(tmp_path, variants=variants, runs=4, judge=fails, outputs=False, factors=factors)
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/campaign/{NAME}")
        expect(page.get_by_text("separate failures best. The effect of")).to_contain_text(
            "margin and "
        )
        expect(page.get_by_label("Across")).to_have_value("margin")
        effects = page.get_by_role("region", name="Effect of factors on failures").get_by_role(
            "button"
        )
        expect(effects.first).to_contain_text("margin ≤ 0.02 m")
        expect(effects.first).to_contain_text("75 % unsuccessful, 0 % elsewhere")
        expect(effects).to_have_count(3)
        expect(page.get_by_role("columnheader", name="map_file")).to_have_count(0)
        effects.filter(has_text="floor_plan").click()
        expect(page.get_by_label("Across")).to_have_value("floor_plan")
        page.get_by_label("Filter").fill("map_file=depot.yaml margin<0.05")
        expect(page.get_by_role("main").get_by_role("status")).to_have_text("12 of 48 runs")


def test_lines_are_chosen_along_an_axis_and_axes_moved(page: Page, server: ShownPage) -> None:
    page.goto(f"{server.address}#/campaign/{NAME}?view=parallel")
    axes = page.locator(".parallel .axis")
    usual = ["speed", "width", "map", "mean duration [s]", "failure rate"]
    expect(axes).to_have_text(usual)
    axes.nth(1).press("ArrowLeft")
    expect(axes).to_have_text(["width", "speed", *usual[2:]])
    page.get_by_text("Axes 5").click()
    page.get_by_label("Search axes").fill("wid")
    page.get_by_label("width", exact=True).uncheck()
    page.keyboard.press("Escape")
    expect(axes).to_have_text(["speed", *usual[2:]])
    chart = page.locator(".parallel canvas").last
    box = chart.bounding_box()
    assert box is not None
    x = box["x"] + box["width"] / 8  # the middle of the first of four axes
    page.mouse.move(x, box["y"] + 20)
    page.mouse.down()
    page.mouse.move(x, box["y"] - 20)
    page.mouse.up()
    status = page.get_by_role("main").get_by_role("status")
    expect(status).to_have_text("16 of 48 runs")
    page.mouse.move(x, box["y"] + 8)
    expect(page.locator(".about-line")).to_contain_text("speed 2")
    page.reload()
    expect(status).to_have_text("16 of 48 runs")
    page.get_by_role("button", name="Only the selected lines").click()
    expect(status).to_have_text("48 runs")


def test_what_is_shown_can_be_saved(page: Page, server: ShownPage) -> None:
    page.goto(f"{server.address}#/campaign/{NAME}?q=speed%3D2&verdict=failed")
    expect(page.get_by_role("main").get_by_role("status")).to_have_text("4 of 48 runs")
    with page.expect_download() as download:
        page.get_by_role("button", name="Save CSV").last.click()
    assert download.value.suggested_filename == f"{NAME}-runs.csv"
    lines = Path(download.value.path()).read_text(encoding="utf-8").splitlines()
    assert lines[0].split(",")[:6] == ["variant", "run", "verdict", "speed", "width", "map"]
    assert lines[1].startswith("hall-9,0,failed,2,0.8,hall,")
    assert len(lines) == 5


def test_everything_can_be_reached_with_keys(page: Page, server: ShownPage) -> None:
    page.goto(f"{server.address}#/campaign/{NAME}")
    page.get_by_role("tab", name="Matrix").focus()
    page.keyboard.press("ArrowRight")
    expect(page.get_by_role("tab", name="Parallel coordinates")).to_be_focused()
    page.keyboard.press("ArrowDown")
    expect(page.locator("tr[data-row]").first.get_by_role("link")).to_be_focused()
    page.get_by_role("tab", name="Parallel coordinates").focus()
    page.keyboard.press("ArrowLeft")
    page.locator('[data-cell="0,0"]').focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    expect(page.locator('[data-cell="1,1"]')).to_have_attribute("aria-pressed", "true")
    page.get_by_role("region", name="Runs", exact=True).focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowDown")
    row = page.locator("tr[data-row]").nth(1).get_by_role("link")
    expect(row).to_be_focused()
    page.keyboard.press("Enter")
    expect(page.get_by_role("tab", name="Log")).to_be_visible()


def test_columns_are_chosen_and_remembered(page: Page, server: ShownPage) -> None:
    page.goto(f"{server.address}#/campaign/{NAME}")
    heads = page.get_by_role("region", name="Runs", exact=True).get_by_role("columnheader")
    usual = ["Verdict↑", "Run", "Reason", "speed", "width", "map", "Duration", "Started"]
    expect(heads).to_have_text(usual)
    page.get_by_text(re.compile("^Columns")).click()
    page.get_by_label("Started").uncheck()
    page.get_by_label("Search columns").fill("varied wi")
    page.get_by_role("group", name="Varied").get_by_label("width").uncheck()
    expect(page.get_by_role("checkbox")).to_have_count(1)
    page.keyboard.press("Escape")
    fewer = [*usual[:4], *usual[5:7]]
    expect(heads).to_have_text(fewer)
    page.goto(f"{server.address}#/campaign/{LATER}")
    expect(heads).to_have_text(fewer)
    page.get_by_text(re.compile("^Columns")).click()
    page.get_by_role("button", name="Reset").click()
    expect(heads).to_have_text(usual)


def test_a_misspelt_parameter_is_named(page: Page, server: ShownPage) -> None:
    page.goto(f"{server.address}#/campaign/{NAME}?q=sped>1")
    expect(page.get_by_text("Unknown parameter or column “sped”")).to_be_visible()
    page.get_by_role("button", name="speed", exact=True).last.click()
    expect(page.get_by_label("Filter")).to_have_value("speed>1")


def test_a_log_is_searched_and_filtered(page: Page, server: ShownPage) -> None:
    page.goto(f"{server.address}#/campaign/{NAME}/hall-9/0")
    lines = page.get_by_role("region", name="Lines of the log").get_by_role("listitem")
    expect(lines).to_have_count(len(SYSTEM_LOG.splitlines()))
    page.get_by_role("button", name="error 4").click()
    expect(lines).to_have_count(4)
    page.get_by_label("Search").fill("GOAL NOT")
    expect(lines).to_have_count(1)
    expect(lines.locator("mark")).to_have_text("goal not")


def test_a_log_opens_at_its_first_error_with_seconds_since_the_start(
    page: Page, tmp_path: Path
) -> None:
    root = write_campaign(tmp_path, judge=lambda *_: "failed")
    lines = [f"[INFO] [{START + i / 1000:.3f}] [robot]: line {i}" for i in range(5000)]
    lines[90] = f"[ERROR] [{START + 0.09:.3f}] [robot]: collision"
    write(root / "_jobs" / "job-0" / "logs" / "system.log", "\n".join(lines))
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/campaign/{NAME}/hall-1/0")
        log = page.get_by_role("region", name="Lines of the log").get_by_role("listitem")
        wrong = log.filter(has_text="collision")
        expect(wrong).to_be_in_viewport()
        expect(wrong.locator(".when")).to_have_text("0.090 s")
        expect(wrong.locator(".said")).to_have_text("[ERROR] [robot]: collision")
        page.get_by_role("button", name="Last lines").click()
        expect(log.last.locator(".when")).to_have_text("4.999 s")
        page.get_by_role("button", name="First error").click()
        expect(wrong).to_be_in_viewport()


def test_plots_show_places_over_the_seconds_since_the_start(page: Page, tmp_path: Path) -> None:
    run = write_campaign(tmp_path) / "hall-1" / "0"
    rows = (f"{START + i:.0f},0,{i},{i}" for i in range(1, 9))
    header = "stamp,pose.covariance[0],pose.covariance[1],pose.position.x"
    write(run / "odom.csv", "\n".join([header, *rows]))
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/campaign/{NAME}/hall-1/0?tab=plots")
        expect(page.get_by_role("combobox", name="Table")).to_have_value(re.compile("poses.csv$"))
        page.get_by_role("combobox", name="Table").select_option("odom.csv")
        plot = page.get_by_role("img", name=re.compile("^Columns of the table"))
        expect(plot).to_have_accessible_name(
            re.compile(r"pose.position.x, .*over time since the start \[s\]$")
        )
        plot.locator(".u-over").hover(position={"x": 2, "y": 20})
        expect(plot.locator(".u-value").first).to_have_text("1")


def test_a_column_is_drawn_for_all_runs_of_a_configuration(page: Page, server: ShownPage) -> None:
    page.goto(f"{server.address}#/campaign/{NAME}/hall-9/0?tab=plots")
    page.get_by_role("button", name="All runs").click()
    status = page.get_by_role("tabpanel").get_by_role("status")
    expect(status).to_contain_text("This run and 3 other runs.")
    plots = page.get_by_role("img", name=re.compile("^position.x of 4 runs: run 1, run 2, run 3, "))
    expect(plots).to_have_count(1)
    page.get_by_role("combobox", name="Table").select_option("resource_usage_main.csv")
    expect(page.get_by_role("button", name="All runs")).to_have_count(0)  # it is of the job


def test_a_text_is_searched_in_the_logs_of_all_runs(page: Page, tmp_path: Path) -> None:
    root = write_campaign(tmp_path, runs=60, judge=lambda _, n: "passed" if n % 2 else "failed")
    for job in (3, 4):
        write(root / "_jobs" / f"job-{job}" / "logs" / "system.log", "sensor <b>lost\n")
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/campaign/{NAME}?view=logs")
        page.get_by_label("Text in the logs").fill("SENSOR")
        page.keyboard.press("Enter")
        expect(page.get_by_role("search").get_by_role("status")).to_have_text(
            "2 matching runs, 120 runs searched"
        )
        headings = page.get_by_role("tabpanel").get_by_role("heading", level=2)
        expect(headings).to_have_text([re.compile("^goal not reached.* 1 run$"), "passed 1 run"])
        expect(page.locator(".found code").first).to_have_text("sensor <b>lost")
        page.locator(".found").get_by_role("link", name="hall-1/4").click()
        expect(page.locator("mark")).to_have_text("sensor")


def test_a_campaign_that_runs_needs_no_reload(page: Page, tmp_path: Path) -> None:
    root = write_campaign(tmp_path, outputs=False)
    shutil.rmtree(root / "hall-1" / "1")
    write(root / ".running" / "lock", "")
    write(root / ".running" / "job-7" / "console.log", "[INFO] [1772630684.0] [n]: begins\n")
    log = root / ".running" / "job-7" / "console.log"
    with (root / ".running" / "lock").open() as lock, browsing(page, root) as address:
        fcntl.flock(lock, fcntl.LOCK_EX)
        page.goto(f"{address}#/campaign/{NAME}")
        expect(page.get_by_role("heading", level=1)).to_contain_text("running")
        expect(page.get_by_role("main").get_by_role("status")).to_have_text("3 runs")
        write_run(root, "hall-1", 1, 2, {"speed": 1.0}, lambda *_: "errored", outputs=False)
        expect(page.get_by_role("main").get_by_role("status")).to_have_text("4 runs")
        page.get_by_role("link", name="job-7").click()
        expect(page.get_by_text("begins")).to_be_visible()
        log.write_text(log.read_text() + "[INFO] [1772630685.0] [n]: goes on\n")
        expect(page.get_by_text("goes on")).to_be_visible()
        page.go_back()
        fcntl.flock(lock, fcntl.LOCK_UN)
        expect(page.get_by_role("heading", level=1)).to_contain_text("finished")


def test_a_campaign_says_that_it_was_stopped_or_removed(page: Page, tmp_path: Path) -> None:
    root = write_campaign(tmp_path, outputs=False)
    shutil.rmtree(root / "hall-1" / "1")
    (root / "hall-1" / "0" / "run.json").write_text("{")
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/campaign/{NAME}")
        expect(page.get_by_role("main")).to_contain_text("1 not run")
        expect(page.locator(".command code")).to_contain_text(f"--resume={root}")
        page.get_by_role("link", name="hall-1/0").click()
        expect(page.get_by_role("heading", level=1)).to_contain_text("errored")
        expect(page.locator(".reason")).to_contain_text("run.json cannot be read")
        page.go_back()
        expect(page.get_by_role("heading", level=1)).to_contain_text("incomplete")
        shutil.rmtree(root)
        expect(page.get_by_role("alert")).to_contain_text(re.compile(f"There is no .*{NAME}"))


def test_a_configuration_is_drawn_on_its_map(page: Page, server: ShownPage) -> None:
    page.goto(f"{server.address}{SCREENS['map']}")
    picture = page.get_by_role("img", name="Map of hall-9")
    expect(picture).to_have_js_property("naturalWidth", 800)


def test_a_drive_is_played_with_keys_and_looked_at_from_any_moment(
    page: Page, server: ShownPage
) -> None:
    page.goto(f"{server.address}#/campaign/{NAME}/hall-9/0?tab=player")
    player = page.get_by_role("region", name="Playback")
    where = player.locator(".where")
    expect(where).to_contain_text("16.90 of 19.90 s · x ")  # it failed: shortly before its end
    player.focus()
    page.keyboard.press("Home")
    expect(where).to_contain_text("0.00 of 19.90 s · x 3.00 m, y 0.00 m, 90°")
    page.keyboard.press("ArrowRight")
    expect(where).to_contain_text("1.00 of 19.90 s")
    before = player.locator("canvas").first.screenshot()
    page.keyboard.press("Space")
    expect(player.get_by_role("button", name="Pause")).to_be_visible()
    expect(where).to_contain_text(re.compile(r"(?<!\d)([2-9]|1\d)\.\d\d of 19\.90 s"))
    page.keyboard.press("Space")
    assert player.locator("canvas").first.screenshot() != before
    player.get_by_role("button", name=re.compile("collision with the wall")).click()
    expect(where).to_contain_text("19.50 of 19.90 s")
    page.wait_for_url("**t=19.50")
    player.get_by_label("Compare with run").select_option("hall-9/1")
    expect(where).to_have_count(2)
    page.reload()
    expect(where.last).to_contain_text("19.50 of 19.90 s · x ")
    expect(player.locator("canvas.stage")).to_have_count(1)
    player.get_by_role("button", name="Side by side").click()
    expect(player.locator("canvas.stage")).to_have_count(2)
    player.get_by_role("button", name="All runs").click()
    expect(player.get_by_role("status")).to_have_text("1 other run on the map, all passed.")


def test_the_camera_shows_what_it_saw_at_the_moment_that_is_looked_at(
    page: Page, server: ShownPage
) -> None:
    page.goto(f"{server.address}#/campaign/{NAME}/hall-9/0?tab=player&t=0")
    seen = page.get_by_role("img", name="Camera image of hall-9/0")
    page.get_by_role("region", name="Playback").focus()

    def shows(red: int) -> bool:
        picture = Image.open(io.BytesIO(seen.screenshot())).convert("RGB")
        return abs(picture.resize((1, 1)).getpixel((0, 0))[0] - red) < 4

    for key, expected in (("Home", 0), ("ArrowRight", 10), ("End", 198)):
        page.keyboard.press(key)
        eventually(partial(shows, expected))
    page.get_by_label("Compare with run").select_option("hall-9/1")
    expect(page.locator(".where")).to_have_count(2)
    expect(page.locator("canvas.sight")).to_have_count(1)
    heights = "rows => rows.map(row => [row.offsetHeight, row.parentElement.offsetHeight])"
    names = page.locator(".happenings button > span").evaluate_all(heights)
    assert all(own <= row for own, row in names)


def test_what_a_recording_lacks_is_said_and_the_rest_is_shown(page: Page, tmp_path: Path) -> None:
    run = write_campaign(tmp_path / "results", outputs=False) / "hall-1" / "0"
    with DriveBag(run / "rosbag2") as bag:
        for tenth in (*range(20), *range(80, 100)):
            bag.odometry(tenth / 10, 1.0, 1.0, 0.0)
        whole = photo(200)
        bag.picture(1.0, whole[: whole.index(b"\xff\xda")])  # its size, and nothing to see
    with browsing(page, tmp_path / "results") as address:
        page.goto(f"{address}#/campaign/{NAME}/hall-1/0?tab=player&t=5")
        player = page.get_by_role("region", name="Playback")
        lacks = player.get_by_role("note")
        expect(lacks).to_contain_text("Without a map")
        expect(lacks).to_contain_text("Without the laser")
        expect(lacks).to_contain_text("The robot never moved more than 5 cm.")
        expect(lacks).to_contain_text("The camera image at 1.00 s is damaged.")
        where = player.locator(".where")
        expect(where).to_contain_text("x 1.00 m, y 1.00 m")
        expect(where).to_contain_text("image from 1.0 s · no pose for 3.1 s")


def test_a_small_map_leads_to_the_run_that_failed(page: Page, server: ShownPage) -> None:
    page.goto(f"{server.address}#/campaign/{NAME}?view=maps")
    page.get_by_label("Filter").fill("speed=2 width=0.8 map=hall")
    page.get_by_role("link", name=re.compile(r"^hall-9: \d+ % unsuccessful")).click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("hall-9/0")
    expect(page.get_by_role("region", name="Playback")).to_be_visible()


def test_a_place_where_runs_fail_leads_to_one_of_them(page: Page, server: ShownPage) -> None:
    page.goto(f"{server.address}#/campaign/{NAME}?view=maps")
    places = page.get_by_role("group", name=re.compile("^Map with"))
    expect(places).to_have_count(2)
    expect(places.first.get_by_role("button")).to_have_accessible_name(
        re.compile(r"^\d+ failures at 9.9, 1.0$")
    )
    page.get_by_label("Filter").fill("speed=2 width=0.8 map=hall verdict=failed")
    place = places.get_by_role("link", name="1 failure at 9.9, 1.0: hall-9/0")
    expect(place).to_be_in_viewport()
    place.click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("hall-9/0")
    expect(page.get_by_role("region", name="Playback")).to_contain_text("16.90 of 19.90 s")


def test_a_search_is_mapped_looked_at_with_keys_and_followed_while_it_runs(
    page: Page, tmp_path: Path
) -> None:
    root = write_search(tmp_path / "results", LIMITS, batches=2)
    (root / ".running").mkdir()
    with open(root / ".running/lock", "w") as lock, browsing(page, tmp_path / "results") as address:
        fcntl.flock(lock, fcntl.LOCK_EX)
        page.goto(f"{address}#/campaign/{LIMITS}")
        expect(page.locator(".search-state")).to_contain_text(
            "Running. 24 parameter sets evaluated in 2"
        )
        table = page.get_by_role("region", name="Critical values")
        expect(table.get_by_role("row")).to_have_count(3)
        dry = table.inner_text()
        legend = page.get_by_role("img", name=re.compile("^failing: ")).locator(".u-legend")
        expect(legend).to_contain_text("failing_low")
        page.locator(".place-of").get_by_label("surface").select_option(label="wet")
        expect(table).not_to_have_text(dry)
        write_search(tmp_path / "results", LIMITS)
        expect(page.locator(".search-state")).to_contain_text(
            "Finished: batches 4/4. 48 parameter sets"
        )
        expect(page.get_by_text("batches 4 / 4")).to_be_visible()
        command = page.locator(".search .command code")
        expect(command).to_have_text(re.compile(rf"--resume=.*{LIMITS} --batches 6$"))
        field = page.get_by_role("application", name="48 parameter sets over speed and load")
        field.focus()
        page.keyboard.press("ArrowRight")
        expect(page.get_by_text("· boundary 0.1.0, ")).to_contain_text(" of 3 runs")
        page.keyboard.press("Enter")
        expect(page.get_by_role("heading", level=1)).to_have_text(re.compile("c[0-9a-f]{12}/0"))


def test_a_comparison_says_what_got_worse(page: Page, server: ShownPage) -> None:
    page.goto(server.address)
    page.get_by_label(f"Compare {NAME}").check()
    page.get_by_label(f"Compare {LATER}").check()
    page.get_by_role("link", name="Compare").click()
    expect(page.locator(".statement")).to_contain_text("unsuccessful runs rose from ")
    expect(page.locator(".statement")).to_contain_text("chance alone hardly explains it")
    expect(page.locator("tr[data-row]")).to_have_count(len(VARIANTS))


def test_several_campaigns_are_compared_with_the_oldest(page: Page, server: ShownPage) -> None:
    page.goto(server.address)
    for name in (LAST, NAME, LATER):
        page.get_by_label(f"Compare {name}").check()
    page.get_by_role("link", name=f"Compare {NAME} with 2 later campaigns").click()
    campaigns = page.get_by_role("region", name="Campaigns")
    expect(campaigns.get_by_role("rowheader")).to_have_text([LATER, LAST])
    rows = page.get_by_role("region", name="Configurations").locator("tr[data-row]")
    expect(rows).to_have_count(len(VARIANTS))
    expect(rows.first.get_by_role("img", name="unclear").first).to_be_visible()
    page.get_by_text("After 2").click()
    page.get_by_role("checkbox", name=LATER).uncheck()
    page.keyboard.press("Escape")
    expect(page.locator(".statement")).to_contain_text("The rate of unsuccessful runs")
    page.go_back()
    expect(page.get_by_role("heading", level=1)).to_have_text("Campaigns")


def test_a_configuration_has_a_history(page: Page, server: ShownPage, tmp_path: Path) -> None:
    page.goto(f"{server.address}#/campaign/{LATER}/hall-9/0?tab=history")
    dots = page.get_by_role("list", name="hall-9 over campaigns").get_by_role("link")
    expect(dots).to_have_count(3)
    expect(dots.nth(1)).to_have_attribute("aria-current", "page")
    expect(page.get_by_text("hall-9 in 3 campaigns, oldest first.")).to_be_visible()
    expect(page.get_by_text("An empty dot means that all runs passed.")).to_be_visible()
    assert "rgba(0, 0, 0, 0) 0" in dots.first.evaluate("e => getComputedStyle(e).backgroundImage")
    name = dots.first.get_attribute("aria-label") or ""
    assert re.fullmatch(rf"{NAME}; \d of 4 unsuccessful", name)
    page.screenshot(path=tmp_path / "history.png")
    dots.first.click()
    expect(page).to_have_url(re.compile(rf"#/campaign/{NAME}\?q=variant%3Dhall-9$"))


def test_a_comparison_says_what_changed_and_what_it_could_have_shown(
    page: Page, tmp_path: Path
) -> None:
    for name, image in ((NAME, "robots/hall:7"), (LATER, "robots/hall:8")):
        root = write_campaign(tmp_path, name, judge=judge(1, 0), outputs=False)
        record = root / "_execution" / "execution.yaml"
        record.write_text(record.read_text().replace("robots/hall:7", image))
    write(tmp_path / LATER / "_config" / "hall.vast", "version: 1\nexecution: {runs: 2}\n")
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/compare?a={NAME}&b={LATER}")
        changed = page.get_by_role("region", name="Changes")
        expect(changed.get_by_role("region", name="lines of hall.vast")).to_contain_text(
            "+execution: {runs: 2}"
        )
        expect(changed.get_by_role("region", name="lines of image")).to_contain_text(
            "-robots/hall:7"
        )
        expect(page.get_by_text("cannot fall below 0.333")).to_contain_text(
            "5 runs of each configuration are needed"
        )


def test_a_jump_in_a_history_has_what_changed_beside_it(page: Page, tmp_path: Path) -> None:
    for name, bad, code in ((NAME, 4, "0.35"), (LATER, 0, "0.9"), (LAST, 4, "0.9")):
        root = write_campaign(tmp_path, name, runs=5, judge=fails_in(bad), outputs=False)
        write(root / "_config" / "files" / "pilot.py", f"AHEAD = {code}\n")
        record = root / "_execution" / "execution.yaml"
        record.write_text(record.read_text().replace("2026-03-04T", f"{name[5:15]}T"))
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/campaign/{NAME}/hall-1/0?tab=history")
        rows = page.get_by_role("tabpanel").locator("tr[data-row]")
        expect(rows).to_have_count(3)  # the latest first
        expect(rows.nth(0)).to_contain_text("nothing recorded changed")
        expect(rows.nth(1)).to_contain_text("files/pilot.py")
        expect(rows.nth(2)).not_to_contain_text("changed")


def fails_in(bad: int):
    return lambda _, number: "failed" if number < bad else "passed"


def test_a_comparison_keeps_the_axes_and_says_nothing_of_one_campaign(
    page: Page, tmp_path: Path
) -> None:
    """Before, the margin separates failures best; after, the speed does."""
    variants = [{"margin": m, "speed": v} for m in (1, 2, 3) for v in (1, 2, 3)]
    for name, factor in ((NAME, "margin"), (LATER, "speed")):
        judge = lambda of, _, factor=factor: "failed" if of[factor] == 1 else "passed"  # noqa: E731
        write_campaign(tmp_path, name, variants=variants, runs=6, judge=judge, outputs=False)
    with browsing(page, tmp_path) as address:
        for first, second in ((NAME, LATER), (LATER, NAME)):
            page.goto("about:blank")
            page.goto(f"{address}#/campaign/{first}")
            expect(page.get_by_text("separate failures best")).to_have_count(1)
            across = page.get_by_label("Across").input_value()
            assert across == ("margin" if first == NAME else "speed")
            for a, b in ((first, second), (second, first)):
                page.goto(f"{address}#/compare?a={a}&b={b}")
                expect(page.get_by_text("Change by parameter")).to_be_visible()
                expect(page.get_by_label("Across")).to_have_value(across)
                expect(page.get_by_text("separate failures best")).to_have_count(0)


def test_causes_have_their_range_and_separate_groups(page: Page, tmp_path: Path) -> None:
    root = write_campaign(
        tmp_path, variants=[{"speed": 1.0}], runs=20, judge=lambda *_: "failed", outputs=False
    )
    for number in range(20):
        record = root / "hall-1" / str(number) / "run.json"
        after = "0.1" if number < 5 else f"{0.4 * number:.1f}"
        data = json.loads(record.read_text())
        data["reason"] = f"collision after {after} s at {number / 10:.1f}, 2.0"
        record.write_text(json.dumps(data))
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/campaign/{NAME}")
        causes = page.get_by_role("region", name="Causes of unsuccessful runs").get_by_role(
            "button"
        )
        expect(causes).to_have_count(2)
        expect(causes.nth(0)).to_contain_text("collision after 2.0 – 7.6 s at …")
        expect(causes.nth(0)).to_contain_text("0.5 – 1.9")
        expect(causes.nth(1)).to_contain_text("collision after 0.1 s at …")
        causes.nth(1).click()
        expect(page.get_by_role("main").get_by_role("status")).to_have_text("5 of 20 runs")


def test_a_campaign_is_readable(page: Page, tmp_path: Path) -> None:
    """Poses are short, what they are short for is said, and mixed verdicts are strips."""
    pose, other = ({"position": {"x": 3.98123, "y": y, "z": 0.5}} for y in (-3.1288, 1.5))
    root = write_campaign(
        tmp_path,
        variants=[{"speed": s, "goal": goal} for s in (1.0, 2.0) for goal in (pose, other)],
        judge=judge(1, 0),
        outputs=False,
    )
    text = "metadata: {title: Two speeds, description: Which one is sound}\n"
    write(root / "_config" / "hall.vast", text)
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/campaign/{NAME}")
        expect(page.get_by_text("Two speeds")).to_be_visible()
        expect(page.get_by_text("Which one is sound")).to_be_visible()
        short = page.get_by_role("cell", name="3.98, -3.13", exact=True).first
        whole = json.dumps(pose, separators=(",", ":"))
        expect(short.locator("[title]")).to_have_attribute("title", whole)
        page.get_by_role("tab", name="Matrix").press("/")
        page.keyboard.type("speed>1")
        expect(page.get_by_label("Filter")).to_have_value("speed>1")
        page.get_by_role("tab", name="Mixed verdicts").click()
        mixed = page.get_by_role("region", name="Configurations with mixed verdicts")
        expect(mixed.get_by_role("img", name="1 of 2 unsuccessful").first).to_have_text("✕✓")
        page.get_by_role("tab", name="Sources").click()
        expect(page.get_by_role("region", name="Text of hall.vast")).to_have_text(text)
        page.goto(f"{address}#/campain/{NAME}")
        expect(page.get_by_role("heading", name="Page not found")).to_be_visible()


def test_one_returns_to_where_one_was(page: Page, tmp_path: Path) -> None:
    write_campaign(tmp_path, runs=100, outputs=False)
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/campaign/{NAME}?sort=variant")
        expect(page.get_by_role("main").get_by_role("status")).to_have_text("200 runs")
        page.locator(".grid").evaluate("grid => grid.scrollTop = 3000")
        row = page.get_by_role("link", name="hall-1/92")
        row.click()
        expect(page.get_by_role("heading", level=1)).to_contain_text("hall-1/92")
        seen = "[scrollY, document.activeElement.tagName]"
        eventually(lambda: page.evaluate(seen) == [0, "MAIN"])
        page.go_back()
        expect(row).to_be_in_viewport()


def test_a_malicious_folder_does_nothing(page: Page, tmp_path: Path) -> None:
    root = write_campaign(tmp_path, outputs=False)
    run = write_run(root, EVIL, 0, 4, {EVIL: EVIL, "speed": 1}, lambda *_: "failed")
    record = json.loads((run / "run.json").read_text())
    write(run / "run.json", json.dumps({**record, "reason": EVIL, "image": EVIL, "host": EVIL}))
    write(run / f"{EVIL.replace('/', '')}.csv", f"{EVIL},b\n{EVIL},1\n{EVIL},2\n")
    write(run / "picture.svg", "<svg xmlns='http://www.w3.org/2000/svg' onload='stolen=1'/>")
    write(run / "page.html", "<script>stolen=1</script>")
    write(run / "rosbag2" / "metadata.yaml", BAG.replace("/scan", f"'{EVIL}'"))
    write(root / "_jobs" / "job-4" / "logs" / "system.log", f"[ERROR] {EVIL}\n<script>stolen=1\n")
    name = page.evaluate("encodeURIComponent", EVIL)
    tabs = ("log", "plots", "resources", "parameters", "bag", "files")
    places = [f"#/campaign/{NAME}", f"#/campaign/{NAME}?view=parallel&x={name}", "#/"]
    places += [f"#/campaign/{NAME}/{name}/0?tab={tab}&find=%3Cscript" for tab in tabs]
    places += [f"#/campaign/{name}", f"#/{name}?q={name}", f"#/compare?a={NAME}&b={name}"]
    with browsing(page, tmp_path) as address:
        for place in places:
            page.goto(address + place)
            settled(page)
            assert page.evaluate("typeof stolen") == "undefined", place
            assert page.locator("[onerror], main script").count() == 0, place
        page.goto(f"{address}#/campaign/{NAME}/{name}/0?tab=files")
        with page.expect_download() as download:
            page.get_by_role("link", name="page.html").click()
        assert download.value.suggested_filename == "page.html"


def test_a_table_of_any_length_holds_the_rows_in_sight(page: Page, tmp_path: Path) -> None:
    write_campaign(tmp_path, runs=300, outputs=False)
    with browsing(page, tmp_path) as address:
        page.goto(f"{address}#/campaign/{NAME}?sort=variant")
        expect(page.get_by_role("main").get_by_role("status")).to_have_text("600 runs")
        assert page.locator("tr[data-row]").count() < 60
        page.locator(".grid").evaluate("grid => grid.scrollTop = grid.scrollHeight")
        expect(page.get_by_role("link", name="hall-2/299")).to_be_visible()

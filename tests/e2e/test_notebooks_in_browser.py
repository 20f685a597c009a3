"""Notebooks in a real browser: executed by a click, shown in a frame that can do nothing."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect, sync_playwright
from robovast_testbed import debian
from support.campaigns.notebooks import add_notebooks, notebook_of
from support.campaigns.searches import write_search
from support.campaigns.stored import NAME, write, write_campaign
from support.patience import PATIENCE, eventually
from support.servers.page import ShownPage, shown

DATA = "DATA_DIR = ''"
EVIL = """
<script>top.stolen = 1; parent.document.title = 'stolen'; fetch('../api/campaigns')</script>
<img src=x onerror="top.stolen = 1"><img src="https://evil.example/pixel.png">
<meta http-equiv="refresh" content="0; url=https://evil.example/">
<form action="https://evil.example/" method="post"><button>Send</button></form>
<a href="https://evil.example/" target="_top">Leave</a> <b>harmless</b>
"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ShownPage]:
    folder = tmp_path_factory.mktemp("notebooks")
    root = write_campaign(folder / "results", runs=1)
    evil = (DATA, f"from IPython.display import HTML\nHTML({EVIL!r})")
    add_notebooks(
        root, {"Evil": {"run": evil}, "Sum": {"campaign": (DATA, "print(3 + 4)", "1 / 0")}}
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        with shown(root.parent) as server:
            yield server


@pytest.fixture
def page() -> Iterator[Page]:
    debian.require("chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox"]
        )
        page = browser.new_page()
        page.set_default_timeout(1000 * PATIENCE)
        expect.set_options(timeout=1000 * PATIENCE)
        yield page
        page.goto("about:blank")  # it leaves before the server does
        browser.close()


def test_a_notebook_is_executed_by_a_click_and_shown_with_its_error(
    page: Page, server: ShownPage, tmp_path: Path
) -> None:
    page.goto(f"{server.address}#/campaign/{NAME}?view=notebooks")
    page.get_by_role("button", name="Run notebook").click()
    frame = page.frame_locator("iframe")
    expect(frame.get_by_text("7", exact=True)).to_be_visible()
    expect(page.get_by_role("alert")).to_have_text(
        "Cell 3 failed: ZeroDivisionError: division by zero"
    )
    expect(frame.get_by_text("1 / 0", exact=True)).to_be_visible()
    expect(frame.get_by_text("print(3 + 4)")).to_be_hidden()
    frame.get_by_label("Show code").check()
    expect(frame.get_by_text("print(3 + 4)")).to_be_visible()
    page.screenshot(path=tmp_path / "notebook.png")
    page.reload()
    expect(frame.get_by_text("7", exact=True)).to_be_visible()  # kept


def test_what_a_notebook_gives_out_does_nothing_to_the_page(page: Page, server: ShownPage) -> None:
    asked: dict[str, str | None] = {}
    page.on("request", lambda request: asked.update({request.url: None}))
    page.on("requestfailed", lambda request: asked.update({request.url: request.failure}))
    page.goto(f"{server.address}#/campaign/{NAME}/hall-1/0?tab=notebooks")
    page.get_by_role("button", name="Run notebook").click()
    frame = page.frame_locator("iframe")
    expect(frame.get_by_text("harmless", exact=True)).to_be_visible()
    frame.get_by_role("button", name="Send").click()
    frame.get_by_role("link", name="Leave").click()
    page.wait_for_timeout(500)

    def refusals() -> set[str | None]:
        page.wait_for_timeout(100)  # they are heard of meanwhile
        return {asked[url] for url in asked if "evil" in url}

    eventually(lambda: refusals() <= {"csp"}, told="the browser refuses them")
    assert page.evaluate("window.stolen") is None
    assert "stolen" not in page.title()
    assert page.url.startswith(server.address)
    alone = f"{server.address}{page.locator('iframe').get_attribute('src')}"
    page.goto(alone)
    assert page.evaluate("self.origin") == "null"
    assert page.evaluate("window.stolen") is None


def test_a_batch_of_a_search_is_chosen_for_its_notebook(page: Page, tmp_path: Path) -> None:
    root = write_search(tmp_path / "results", batches=3, runs=False, strategy="random")
    (document,) = (root / "_config").glob("*.vast")
    visualization = "evaluation: {visualization: [Round: {batch: round.ipynb}]}\n"
    document.write_text(document.read_text() + visualization)
    cells = (f"{DATA}\nBATCH = None", "print('batch', BATCH + 40)")
    write(root / "_config" / "round.ipynb", notebook_of(*cells))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
        with shown(root.parent) as server:
            page.goto(f"{server.address}#/campaign/{root.name}?view=notebooks")
            expect(page.get_by_role("heading", name="Notebooks of batch 2")).to_be_visible()
            page.get_by_label("Batch").select_option("1")
            expect(page.get_by_role("heading", name="Notebooks of batch 1")).to_be_visible()
            page.get_by_role("button", name="Run notebook").click()
            frame = page.frame_locator("iframe")
            expect(frame.get_by_text("batch 41", exact=True)).to_be_visible()
            page.goto("about:blank")

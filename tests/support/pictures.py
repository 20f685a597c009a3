"""The pictures of docs/, taken of the page by scripts/pictures."""

from __future__ import annotations

import io
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from playwright.sync_api import Browser, expect, sync_playwright

from support.servers.page import VAST, shown

_DRIVES, _SWEEP, _CAMERA = "robot-navigation", "robot-sweep", "robot-camera"
_SEARCH = "robot-failure-map"
_AMONG_BOXES = 'across=speed&down=margin&at={"boxes":0.583}'
"""Of three boxes."""
_FAILED = f"{_DRIVES}/drive-2-1-2-1/0"
_FLAKY = f"{_SWEEP}/flat-1-1-2-2-2/0"
_SEEN = f"{_CAMERA}/flat-1-1-2/1"
_QUALITY = 85
_DRAWN = 2000
"""How long charts and maps may take until they are drawn [ms]."""


@dataclass(frozen=True)
class Picture:
    """One picture."""

    name: str
    place: str
    """Address in the page, with names of campaigns without their dates."""
    part: str = "body"
    """Selector of what is shown; where machine and folder of the drives are not seen."""
    width: int = 1100
    height: int = 720

    @property
    def file(self) -> str:
        return f"{self.name}.webp"


PICTURES = (
    Picture("campaign", f"campaign/{_DRIVES}?x=margin&y=map_file"),
    Picture("maps", f"campaign/{_DRIVES}?view=maps", height=960),
    Picture("log", _FAILED, ".tabs", height=560),
    Picture("player", f"{_FAILED}?tab=player&t=3.8", ".tabs", height=900),
    Picture("all-runs", f"{_FLAKY}?tab=player&everyone=1&t=1.2", ".stages", height=900),
    Picture("camera", f"{_SEEN}?tab=player&t=3.3", ".scene", width=1000),
    Picture("plots", f"{_FAILED}?tab=plots", ".plot"),
    Picture("search", f"{_SEARCH}?{_AMONG_BOXES}", ".search .beside", width=1300),
    Picture("telephone", _FAILED, width=390, height=760),
)
"""All pictures of the page in docs/pictures."""
REPORT = "report.webp"
"""The picture of what `vast results report` writes."""
_REPORT_HEIGHT = 1700


def _take(browser: Browser, address: str, picture: Picture, names: dict[str, str]) -> bytes:
    size = {"width": picture.width, "height": picture.height}
    page = browser.new_page(viewport=size, color_scheme="light")  # type: ignore[arg-type]
    place = picture.place.removeprefix("campaign/")
    for name, dated in names.items():
        place = place.replace(name, dated, 1)
    page.goto(f"{address}#/campaign/{place}")
    page.wait_for_selector(picture.part)
    expect(page.locator(".loading")).to_have_count(0, timeout=60_000)
    page.wait_for_timeout(_DRAWN)
    found = page.screenshot() if picture.part == "body" else page.locator(picture.part).screenshot()
    page.close()
    return found


def _take_report(browser: Browser, campaign: Path) -> bytes:
    """The begin of a report, and the first configuration in it."""
    page = browser.new_page(viewport={"width": 1000, "height": 720}, color_scheme="light")
    with TemporaryDirectory() as folder:
        file = Path(folder, "report.html")
        subprocess.run([VAST, "results", "report", campaign, "-o", file], check=True)
        page.goto(file.as_uri())
    page.add_style_tag(content="article ~ article { display: none }")
    found = page.screenshot(full_page=True)
    page.close()
    return found


def _save(shot: bytes, file: Path, height: int) -> None:
    taken = Image.open(io.BytesIO(shot))
    taken = taken.crop((0, 0, taken.width, min(taken.height, height)))
    taken.save(file, "WEBP", quality=_QUALITY, method=6)


def take_pictures(results: Path, folder: Path) -> None:
    """Take all pictures of the latest drives in a folder of results."""
    names = {
        name: max(results.glob(f"{name}-*")).name for name in (_DRIVES, _SWEEP, _CAMERA, _SEARCH)
    }
    with shown(results) as server, sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox"]
        )
        for picture in PICTURES:
            shot = _take(browser, server.address, picture, names)
            _save(shot, folder / picture.file, picture.height)
        _save(_take_report(browser, results / names[_DRIVES]), folder / REPORT, _REPORT_HEIGHT)
        browser.close()


if __name__ == "__main__":
    take_pictures(Path(sys.argv[1]).resolve(), Path(sys.argv[2]))

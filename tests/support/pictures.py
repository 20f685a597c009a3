"""The pictures of docs/, taken of the page by scripts/pictures."""

from __future__ import annotations

import io
import sys
from dataclasses import dataclass
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, sync_playwright

from support.servers.page import shown

_DRIVES, _SWEEP = "robot-navigation", "robot-sweep"
_FAILED = f"{_DRIVES}/drive-2-1-2-1/0"
_FLAKY = f"{_SWEEP}/flat-1-1-2-2-2/0"
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
    Picture("plots", f"{_FAILED}?tab=plots", ".plot"),
    Picture("telephone", _FAILED, width=390, height=760),
)
"""All pictures of docs/pictures."""


def _take(browser: Browser, address: str, picture: Picture, names: dict[str, str]) -> bytes:
    size = {"width": picture.width, "height": picture.height}
    page = browser.new_page(viewport=size, color_scheme="light")  # type: ignore[arg-type]
    place = picture.place.removeprefix("campaign/")
    for name, dated in names.items():
        place = place.replace(name, dated, 1)
    page.goto(f"{address}#/campaign/{place}")
    page.wait_for_selector(picture.part)
    page.wait_for_timeout(_DRAWN)
    found = page.screenshot() if picture.part == "body" else page.locator(picture.part).screenshot()
    page.close()
    return found


def take_pictures(results: Path, folder: Path) -> None:
    """Take all pictures of the latest drives in a folder of results."""
    names = {name: max(results.glob(f"{name}-*")).name for name in (_DRIVES, _SWEEP)}
    with shown(results) as server, sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox"]
        )
        for picture in PICTURES:
            taken = Image.open(io.BytesIO(_take(browser, server.address, picture, names)))
            shot = taken.crop((0, 0, taken.width, min(taken.height, picture.height)))
            shot.save(folder / picture.file, "WEBP", quality=_QUALITY, method=6)
        browser.close()


if __name__ == "__main__":
    take_pictures(Path(sys.argv[1]).resolve(), Path(sys.argv[2]))

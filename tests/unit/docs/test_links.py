"""Every link of a page leads somewhere, and the table of contents lists every page."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest
from support.pages import ROOT

PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "configs").rglob("*.md")]
FENCED = re.compile(r"^ *(```+|~~~+|:::+)[^\n]*\n.*?^ *\1 *$", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\(([^)\s]+)\)")


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page: those of its headings, as GitHub and MyST write them."""
    text = FENCED.sub("", page.read_text(encoding="utf-8"))
    included = re.findall(r"\{include\} (\S+)", page.read_text(encoding="utf-8"))
    found = set(re.findall(r'<a id="([^"]+)">', text))
    for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE):
        found.add(re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-"))
    return found.union(*(anchors(page.parent / name) for name in included))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_each_link_of_a_page_leads_somewhere(page: Path) -> None:
    text = re.sub(r"`[^`\n]*`", "", FENCED.sub("", page.read_text(encoding="utf-8")))
    broken = []
    for link in LINK.findall(text):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            broken.append(link)
    assert broken == []


def test_each_page_is_in_the_table_of_contents() -> None:
    listed = {"index"}
    for page in (ROOT / "docs").rglob("*.md"):
        for block in re.findall(r"```\{toctree\}\n(.*?)```", page.read_text(), re.DOTALL):
            names = [line for line in block.splitlines() if line and not line.startswith(":")]
            folder = page.parent.relative_to(ROOT / "docs")
            listed |= {(folder / name).as_posix() for name in names}
    docs = ROOT / "docs"
    assert listed == {p.relative_to(docs).with_suffix("").as_posix() for p in docs.rglob("*.md")}


def test_the_start_page_links_each_page_also_where_no_table_of_contents_is_shown() -> None:
    text = (ROOT / "docs/index.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```\{toctree\}\n(.*?)```", text, re.DOTALL)
    names = [line for block in blocks for line in block.splitlines() if line[:1] not in ("", ":")]
    listed = LINK.findall(FENCED.sub("", text).partition("## All pages")[2])
    assert listed == [f"{name}.md" for name in names]


def test_each_card_of_the_start_page_has_its_options_on_separate_lines() -> None:
    text = (ROOT / "docs/index.md").read_text(encoding="utf-8")
    cards = re.findall(r"^:::\{grid-item-card\} [^\n]+\n(.*?)^:::$", text, re.DOTALL | re.MULTILINE)
    options = r":link: \S+\n:link-type: doc\n[A-Z][^\n]*\.\n"
    assert [card for card in cards if not re.fullmatch(options, card)] == []
    assert len(cards) == text.count("{grid-item-card}") > 3


def test_each_old_page_leads_to_a_page() -> None:
    redirects = runpy.run_path(str(ROOT / "docs/conf.py"))["redirects"]
    for old, new in redirects.items():
        assert not (ROOT / "docs" / f"{old}.md").exists()
        assert (ROOT / "docs" / new).with_suffix(".md").is_file(), old


def test_no_page_names_another_page_without_a_link() -> None:
    for page in (ROOT / "docs").rglob("*.md"):
        if "contributing" not in page.parts and "cli" not in page.parts:
            named = re.findall(r"(?<![\w/-])docs/[\w/-]+\.md", page.read_text(encoding="utf-8"))
            assert named == [], page

"""The commands about finished campaigns print what the pages about failure rates show."""

from __future__ import annotations

import shlex
from itertools import chain
from pathlib import Path

import pytest
from support.campaigns.stored import NAME, write_campaign
from support.pages import ROOT, code_blocks

from robovast_cli.main import command

PAGES = ("docs/how-to/failure-rates.md", "docs/how-to/compare-campaigns.md")
LATER = "hall-2026-03-05-132444"
BAD = {NAME: {1.0: 0, 2.0: 5, 3.0: 30}, LATER: {1.0: 0, 2.0: 24, 3.0: 32}}
"""Runs of 40 that fail, by campaign and speed."""


def commands(about: str) -> list[list[str]]:
    """Return the commands of the pages, without comments."""
    blocks = chain(*(code_blocks(page, "bash") for page in PAGES))
    lines = [line for block in blocks for line in block.splitlines() if about in line]
    return [shlex.split(line, comments=True) for line in lines]


def typed(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Exit code and output of a command."""
    program, *arguments = arguments
    assert program == "vast"
    with pytest.raises(SystemExit) as ended:
        command().main(args=arguments, prog_name="vast")
    return int(ended.value.code or 0), capsys.readouterr().out


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The campaigns of the page."""
    monkeypatch.chdir(tmp_path)
    for name, bad in BAD.items():
        write_campaign(
            tmp_path / "results",
            name,
            variants=[{"speed": speed} for speed in bad],
            runs=40,
            judge=lambda parameters, number, bad=bad: (
                "failed" if number < bad[parameters["speed"]] else "passed"
            ),
            outputs=False,
        )
    return tmp_path / "results"


@pytest.fixture(scope="module")
def page() -> str:
    return "\n".join((ROOT / page).read_text(encoding="utf-8") for page in PAGES)


def test_each_summary_on_the_page_is_printed_as_it_stands_there(results, page, capsys) -> None:
    answers = [typed(line, capsys) for line in commands("vast results summary")]
    assert [code for code, _ in answers] == [0, 0, 0]
    assert f"```text\n{answers[0][1]}```" in page
    assert NAME in answers[2][1]


def test_each_comparison_on_the_page_is_printed_as_it_stands_there(results, page, capsys) -> None:
    answers = [typed(line, capsys) for line in commands("vast results compare")]
    assert [code for code, _ in answers] == [1, 1, 1]
    shown = answers[0][1].splitlines()[:5]
    assert "```text\n" + "\n".join(shown) + "\n```" in page
    assert Path("gate.xml").stat().st_size > 500 < Path("gate.md").stat().st_size


def test_the_report_on_the_page_is_written(results, capsys) -> None:
    (line,) = commands("vast results junit")
    code, out = typed(line, capsys)
    assert (code, out) == (0, "runs.xml: 120 cases of 3 configurations, 56 failed or errored\n")

"""Each command on docs/confidence.md that asks finished campaigns does what it says there."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
from support.campaigns.stored import NAME, write_campaign
from support.pages import ROOT, code_blocks

from robovast_cli.main import command

BAD = {1.0: 0, 2.0: 5, 3.0: 30}
"""Runs of 40 that fail, by speed."""


def commands(about: str) -> list[list[str]]:
    """What the page types, without its comments."""
    blocks = code_blocks("docs/confidence.md", "bash")
    lines = [line for block in blocks for line in block.splitlines() if about in line]
    return [shlex.split(line, comments=True) for line in lines]


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The campaign of the page."""
    monkeypatch.chdir(tmp_path)
    write_campaign(
        tmp_path / "results",
        variants=[{"speed": speed} for speed in BAD],
        runs=40,
        judge=lambda parameters, number: (
            "failed" if number < BAD[parameters["speed"]] else "passed"
        ),
        outputs=False,
    )
    return tmp_path / "results"


def test_each_summary_on_the_page_is_printed_as_it_stands_there(results, capsys) -> None:
    typed = commands("vast results summary")
    assert len(typed) == 3
    answers = []
    for program, *arguments in typed:
        assert program == "vast"
        with pytest.raises(SystemExit) as ended:
            command().main(args=arguments, prog_name="vast")
        assert not ended.value.code
        answers.append(capsys.readouterr().out)
    page = (ROOT / "docs/confidence.md").read_text(encoding="utf-8")
    assert f"```text\n{answers[0]}```" in page
    assert NAME in answers[2]

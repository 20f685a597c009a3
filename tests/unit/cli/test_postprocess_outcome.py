"""The line about a campaign claims nothing that failed."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.analysis.postprocessing.events import Failure, PostprocessingSummary
from robovast_cli.commands.results.postprocess import View


def line(summary: PostprocessingSummary, capsys: pytest.CaptureFixture[str]) -> str:
    View().campaign_finished(summary)
    said = capsys.readouterr()
    return (said.out + said.err).strip()


def test_tables_that_could_not_be_written_are_not_up_to_date(
    capsys: pytest.CaptureFixture[str],
) -> None:
    failure = Failure("hall", "postprocess", "", "cannot write: the disk is full.")
    failed = PostprocessingSummary(Path("hall"), runs=6, failures=[failure])
    assert line(failed, capsys) == "hall: 6 runs, 1 failed"
    document = Path("hall/_config/a.vast")
    for summary, why in (
        (PostprocessingSummary(Path("hall"), document, 6), "the .vast file has no commands"),
        (
            PostprocessingSummary(Path("hall"), runs=6),
            "the campaign has no .vast file, so no commands",
        ),
    ):
        assert f"6 runs, tables and metadata are up to date ({why})" in line(summary, capsys)
        summary.written.append("metadata")
        assert f"6 runs, tables and metadata are written ({why})" in line(summary, capsys)

"""The log of a local campaign takes any text, such as names of files."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.campaigns.local import Recorder

from robovast.campaign.layout import Layout
from robovast.execution.local.controller_log import FILE, logged


def test_what_no_encoding_has_is_written_as_an_escape(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    layout = Layout(tmp_path)
    with logged(layout, Recorder()) as observer:
        observer.message("Not reused: b\udcff-2027/\x1b[31mone")
    assert "b\\udcff-2027/\\x1b[31mone\n" in (layout.execution / FILE).read_text("utf-8")
    assert capsys.readouterr().err == ""

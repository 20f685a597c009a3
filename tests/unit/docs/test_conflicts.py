"""No file holds what Git leaves where two changes meet."""

from __future__ import annotations

import subprocess

from support.pages import ROOT


def test_no_file_holds_the_markers_of_a_conflict() -> None:
    search = ["git", "grep", "-lE", "^(<{7}|>{7}) ", "--", "."]
    found = subprocess.run(search, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (found.stdout, found.stderr) == ("", "")

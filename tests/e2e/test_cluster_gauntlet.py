"""A minute of faults at random, on a cluster of their own: every verdict stays true.

The weekly run takes twenty minutes and another seed.
"""

from __future__ import annotations

from pathlib import Path

from bench.gauntlet import main
from robovast_testbed.pytest_plugin import skipped_when_unavailable


def test_whatever_dies_no_run_is_lost_repeated_misjudged_or_mixed(tmp_path: Path) -> None:
    words = ("--minutes", "1", "--seed", "13", "--alive", "2", "--pause", "3")
    with skipped_when_unavailable():
        assert main([*words, "--evidence", str(tmp_path / "evidence")]) == 0

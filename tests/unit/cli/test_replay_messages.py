"""`vast replay` explains what it cannot execute."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.mark.parametrize(
    ("options", "said", "not_said"),
    [
        (("-n", "3"), "For 3 re-runs, use `vast replay --times 3`", "--context"),
        (("--namespace", "robots"), "`-n` (`--namespace`) selects a run on a cluster", "--times"),
        (("--context", "lab"), "`--context` selects a run on a cluster", "--namespace"),
    ],
)
def test_options_of_clusters_do_not_apply_to_folders(
    vast, tmp_path: Path, options: tuple[str, str], said: str, not_said: str
) -> None:
    (tmp_path / "hall" / "0").mkdir(parents=True)
    outcome = vast("replay", str(tmp_path / "hall" / "0"), *options)
    assert outcome.code == 2
    assert said in outcome.err
    assert not_said not in outcome.err


def test_a_folder_that_is_missing_is_named(vast, tmp_path: Path) -> None:
    outcome = vast("replay", str(tmp_path / "bad" / "0"))
    assert outcome.code == 2
    assert "bad/0: there is no such folder\n" in outcome.err

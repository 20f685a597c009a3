"""What a run has written is copied as it was, or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from robovast.campaign.checksums import DifferentError, checksums, copy_verified


def _sparse(path: Path) -> None:
    os.truncate(path, 2 << 30)


def _pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


@pytest.mark.parametrize("spoil", [_sparse, _pipe, Path.unlink])
def test_a_file_that_cannot_be_read_any_more_is_no_error_of_the_copy(
    tmp_path: Path, spoil: Callable[[Path], None]
) -> None:
    run, target = tmp_path / "hall-1" / "0", tmp_path / "copy"
    run.mkdir(parents=True)
    target.mkdir()
    (run / "test.xml").write_text("passed")
    sums = checksums(run)
    assert sums is not None
    spoil(run / "test.xml")
    with pytest.raises(DifferentError, match="cannot be read"):
        copy_verified(run, target, sums)

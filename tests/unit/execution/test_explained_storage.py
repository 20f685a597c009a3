"""What a full disk stopped is to be continued, or to be begun again."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from robovast.base.errors import StorageError
from robovast.campaign.layout import Layout
from robovast.execution.local.store import storage_errors


def said(root: Path) -> str:
    with pytest.raises(StorageError) as error, storage_errors(root):
        raise OSError(errno.ENOSPC, "No space left on device")
    return str(error.value)


def test_a_campaign_that_has_begun_is_continued(tmp_path: Path) -> None:
    record = Layout(tmp_path).execution_record
    record.parent.mkdir()
    record.touch()
    assert f"then continue with `vast exec local run --resume {tmp_path}`." in said(tmp_path)


def test_one_that_could_not_be_written_cannot_be_continued(tmp_path: Path) -> None:
    assert said(tmp_path) == (
        f"{tmp_path}: the disk is full. Nothing was run. Free some space, then repeat the command."
    )

"""How a file is divided for S3."""

from __future__ import annotations

from itertools import pairwise

import pytest

from robovast.storage.multipart import LARGEST, MOST_PARTS, PART, stretches

GIB = 2**30


@pytest.mark.parametrize("size", [PART + 1, 156 * GIB, 157 * GIB, 1000 * GIB + 7, LARGEST])
def test_a_file_of_any_size_has_no_more_parts_than_s3_allows(size: int) -> None:
    parts = stretches(size)
    assert len(parts) <= MOST_PARTS
    assert parts[0][0] == 0
    assert parts[-1][1] == size
    assert all(end == begin for (_, end), (begin, _) in pairwise(parts))
    assert len({end - begin for begin, end in parts[:-1]}) == 1, "some servers demand that"
    assert PART <= parts[0][1] - parts[0][0] <= 5 * GIB

"""What tells images from others of their name."""

from __future__ import annotations

import pytest

from robovast.base.containers import named_digest

DIGEST = f"sha256:{'0123456789abcdef' * 4}"


@pytest.mark.parametrize(
    ("image", "told"),
    [
        (f"ghcr.io/acme/runs@{DIGEST}", f"ghcr.io/acme/runs@{DIGEST}"),
        (f"ghcr.io/acme/runs:1.4@{DIGEST}", f"ghcr.io/acme/runs@{DIGEST}"),
        (f"localhost:5000/runs:1@{DIGEST}", f"localhost:5000/runs@{DIGEST}"),
        (f"localhost:5000/runs@{DIGEST}", f"localhost:5000/runs@{DIGEST}"),
        ("localhost:5000/runs:1", ""),
        ("runs", ""),
    ],
)
def test_an_image_that_is_named_by_its_digest_is_known_by_it(image: str, told: str) -> None:
    """And one of a tag is not: what a tag means may differ from node to node."""
    assert named_digest(image) == told

"""What is locked is installed as the lock says, whatever an index offers since."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PLACES = ("scripts/*", "container/*/Dockerfile", "src/robovast/execution/local/*.py")
INSTALLERS = [
    path
    for place in PLACES
    for path in sorted(ROOT.glob(place))
    if path.is_file() and "--require-hashes" in path.read_text()
]


@pytest.mark.parametrize("path", INSTALLERS, ids=lambda path: str(path.relative_to(ROOT)))
def test_nothing_beside_a_lock_is_resolved(path: Path) -> None:
    """Older pips resolve `name[extra]` to the newest version, which a lock does not hold."""
    lines = [line for line in path.read_text().splitlines() if "--require-hashes" in line]
    assert [line for line in lines if "--no-deps" not in line] == []


def test_all_installers_are_known() -> None:
    assert [path.name for path in INSTALLERS] == [
        *(
            "release",
            "ros-environment",
            "setup",
            "Dockerfile",
            "Dockerfile",
            "process_environment.py",
        )
    ]

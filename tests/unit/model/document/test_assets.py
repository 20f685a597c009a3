"""Volumes of assets: where they may be mounted, and what a pod gets of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import DocumentError
from robovast.execution.contract import CONFIG, OUT
from robovast.model.document import load_document
from robovast.model.document.assets import Assets

DOCUMENT = """\
version: 1
configuration: [{{name: one}}]
execution:
  scenario_file: a.osc
  kubernetes:
    assets: {assets}
"""


def load(folder: Path, assets: str) -> list[Assets]:
    (folder / "a.osc").write_text("scenario a:\n    do serial:\n        wait elapsed(1s)\n")
    path = folder / "a.vast"
    path.write_text(DOCUMENT.format(assets=assets))
    return load_document(path).vast.execution.kubernetes.assets


@pytest.mark.parametrize(
    "path",
    [
        *(CONFIG, OUT, "/dev/shm", f"{OUT}/maps", "/", "/usr", "/usr/lib", "/ws", "/tmp"),
        *("/etc/passwd", "/proc/1", "/run/secrets"),
    ],
)
def test_a_path_that_would_hide_what_runs_need_is_refused_by_its_name(
    tmp_path: Path, path: str
) -> None:
    with pytest.raises(DocumentError, match=f"a mount at `{path}` would hide"):
        load(tmp_path, f"[{{path: {path}, claim: worlds}}]")


@pytest.mark.parametrize("path", ["assets", "/a/../out", "/a/", "//a", "/a/./b", "'/a:b'", "''"])
def test_a_path_that_is_no_plain_absolute_one_is_refused(tmp_path: Path, path: str) -> None:
    with pytest.raises(DocumentError, match=r"assets\[0\]\.path|assets"):
        load(tmp_path, f"[{{path: {path}, claim: worlds}}]")


def test_room_beside_what_runs_need_may_be_used(tmp_path: Path) -> None:
    paths = ["/assets", "/usr/share/worlds", "/ws/src/maps", "/outer", "/home/me/.gazebo"]
    found = load(tmp_path, str([{"path": path, "claim": "worlds"} for path in paths]))
    assert [one.path for one in found] == paths


@pytest.mark.parametrize(
    ("assets", "said"),
    [
        ("[{path: /a}]", "either a `claim` or an `image`"),
        ("[{path: /a, claim: b, image: c}]", "either a `claim` or an `image`"),
        ("[{path: /a, claim: b}, {path: /a/c, image: d}]", "would hide each other"),
        ("[{path: /a, claim: B}]", "claim"),
    ],
)
def test_each_has_one_place_and_a_path_of_its_own(tmp_path: Path, assets: str, said: str) -> None:
    with pytest.raises(DocumentError, match=said):
        load(tmp_path, assets)

"""The command that messages print installs an extra from where RoboVAST came."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path
from typing import Any

import pytest

from robovast.base import installation
from robovast.base.installation import install_command
from robovast_cli import conflicting_package

METADATA = """Metadata-Version: 2.4
Name: robovast-operator
Version: 9
Provides-Extra: gui
Provides-Extra: mcp
Requires-Dist: rich>=13
Requires-Dist: starlette>=1.0; extra == 'gui'
Requires-Dist: uvicorn<2,>=0.35; extra == 'gui'
Requires-Dist: fastmcp>=4.1; extra == 'mcp'
"""


def words(
    monkeypatch: pytest.MonkeyPatch, folder: Path, origin: dict[str, Any] | None
) -> list[str]:
    """The words after `pip install`, for a RoboVAST that was installed from an origin."""
    info = folder / "robovast_operator-9.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(METADATA)
    if origin is not None:
        (info / "direct_url.json").write_text(json.dumps(origin))
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setattr(installation, "_installer", lambda: "pip install")
    return shlex.split(install_command("gui"))[2:]


def test_from_the_index(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert words(monkeypatch, tmp_path, None) == ["robovast-operator[gui]"]


@pytest.mark.parametrize("name", ["robovast_operator-9-py3-none-any.whl", "with space/r.whl"])
def test_from_a_wheel(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str) -> None:
    wheel = tmp_path / name
    wheel.parent.mkdir(exist_ok=True)
    wheel.touch()
    origin = {"url": wheel.as_uri(), "archive_info": {}}
    assert words(monkeypatch, tmp_path, origin) == [f"{wheel}[gui]"]


@pytest.mark.parametrize(("info", "option"), [({"editable": True}, ["--editable"]), ({}, [])])
def test_from_a_clone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, info: dict[str, bool], option: list[str]
) -> None:
    origin = {"url": tmp_path.as_uri(), "dir_info": info}
    assert words(monkeypatch, tmp_path, origin) == [*option, f"{tmp_path}[gui]"]


@pytest.mark.parametrize(
    ("origin", "address"),
    [
        ({"url": "https://host.invalid/r.whl", "archive_info": {}}, "https://host.invalid/r.whl"),
        (
            {"url": "https://host.invalid/r.git", "vcs_info": {"vcs": "git", "commit_id": "abc"}},
            "git+https://host.invalid/r.git@abc",
        ),
    ],
)
def test_from_an_address(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, origin: dict[str, Any], address: str
) -> None:
    found = words(monkeypatch, tmp_path, origin)
    assert found == [f"robovast-operator[gui] @ {address}"]


def test_when_the_origin_is_gone_the_requirements_are_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    origin = {"url": (tmp_path / "gone.whl").as_uri(), "archive_info": {}}
    assert words(monkeypatch, tmp_path, origin) == ["starlette>=1.0", "uvicorn<2,>=0.35"]


def test_the_command_changes_the_environment_that_runs(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    python = shlex.quote(sys.executable)
    beginnings = (f"{python} -m pip install ", f"uv pip install --python {python} ")
    assert install_command("gui").startswith(beginnings)
    pip = Path(sys.executable).parent / "pip"
    monkeypatch.setattr("shutil.which", lambda name: str(pip))
    assert install_command("gui").startswith("pip install ")


def test_the_other_project_is_named_with_the_remedy(tmp_path: Path) -> None:
    assert conflicting_package.conflict_warning(tmp_path / "absent") is None
    for name in ("robovast_operator-9.dist-info", "robovast_nav-2.dist-info", "robovast"):
        (tmp_path / name).mkdir()
    assert conflicting_package.conflict_warning(tmp_path) is None
    (tmp_path / "robovast-2.2.1.dist-info").mkdir()
    text = conflicting_package.conflict_warning(tmp_path)
    assert text is not None
    assert text.startswith("warning: the package `robovast` 2.2.1 of another project")
    assert "\nhint: uninstall both packages" in text

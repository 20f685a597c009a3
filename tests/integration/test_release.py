"""`scripts/release` builds what is published, and refuses files that state another version."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tarfile
import zipfile
from email import message_from_bytes
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType

import pytest
from robovast_testbed import gobuild, programs

from robovast import __version__

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def script() -> ModuleType:
    loader = SourceFileLoader("release", str(ROOT / "scripts/release"))
    spec = spec_from_loader("release", loader)
    assert spec is not None
    module = module_from_spec(spec)
    loader.exec_module(module)
    return module


def test_all_files_state_one_version(script: ModuleType) -> None:
    assert script.wrong_versions(ROOT, __version__) == []


def test_each_file_with_another_version_is_named(script: ModuleType, tmp_path: Path) -> None:
    for name in script.VERSIONS:
        for copied in script.VERSIONS:
            (tmp_path / copied).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / copied, tmp_path / copied)
        text = (tmp_path / name).read_text()
        (tmp_path / name).write_text(text.replace(__version__, "9.9.9"))
        problems = script.wrong_versions(tmp_path, __version__)
        assert problems
        assert all(problem.startswith(f"{name}:") for problem in problems)
        (tmp_path / name).write_text("")
        assert script.wrong_versions(tmp_path, __version__) == [
            f"{name}: no line matches {script.VERSIONS[name]}"
        ]


def test_a_dry_run_builds_and_checks_everything(tmp_path: Path) -> None:
    clone = tmp_path / "clone"
    subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True, timeout=120)
    environment = {**os.environ, "HELM": str(gobuild.build(programs.HELM))}
    result = subprocess.run(
        [clone / "scripts/release", __version__, "--dry-run"],
        capture_output=True,
        text=True,
        env=environment,
        timeout=600,
    )
    assert result.returncode == 0, result.stderr
    dist = clone / "dist"
    wheel = dist / f"robovast_operator-{__version__}-py3-none-any.whl"
    sdist = dist / f"robovast_operator-{__version__}.tar.gz"
    others = {f"robovast-{__version__}.tgz", "sbom-python.cdx.json", "sbom-operator-image.cdx.json"}
    assert {path.name for path in dist.iterdir()} == {wheel.name, sdist.name, *others}
    assert subprocess.run(["git", "tag"], cwd=clone, capture_output=True, check=True).stdout == b""

    with zipfile.ZipFile(wheel) as archive:
        info = f"robovast_operator-{__version__}.dist-info/METADATA"
        page = str(message_from_bytes(archive.read(info)).get_payload())
    links = re.findall(r"\]\(([^)]+)\)", page)
    assert len(links) > 10
    assert [link for link in links if not link.startswith("https://")] == []

    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"tests/unit/test_locks.py", "tests/testbed/robovast_testbed/pytest_plugin.py"} <= names
    tops = {name.partition("/")[0] for name in names}
    assert not tops & {".ci", ".github", ".vscode"}


def test_without_helm_nothing_is_built(tmp_path: Path) -> None:
    clone = tmp_path / "clone"
    subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True, timeout=120)
    result = subprocess.run(
        [clone / "scripts/release", __version__, "--dry-run"],
        capture_output=True,
        text=True,
        env={**os.environ, "HELM": "no-helm"},
        timeout=60,
    )
    assert (result.returncode, result.stdout) == (1, "")
    assert result.stderr == (
        "error: `no-helm` is not installed\nhint: install Helm, or set HELM to its path\n"
    )
    assert not (clone / "dist").exists()


def test_a_release_of_a_changed_checkout_is_refused(tmp_path: Path) -> None:
    clone = tmp_path / "clone"
    subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True, timeout=120)
    (clone / "new").touch()
    for words, message in {
        (__version__,): "error: there are uncommitted changes",
        ("9.9.9", "--dry-run"): "error: the files do not state this version",
    }.items():
        result = subprocess.run(
            [clone / "scripts/release", *words], capture_output=True, text=True, timeout=60
        )
        assert (result.returncode, result.stdout) == (1, "")
        assert result.stderr.startswith(message)

"""Without extras: each command works, or names the extra that it needs."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import distributions, packages_distributions
from pathlib import Path, PurePath

import pytest
from support.campaigns.finished import NAME, finished_campaign
from support.command_tree import leaves
from support.core_only import ROOT, CoreVast, core_site

from robovast.base.optional_deps import EXTRAS

RUN = f"results/{NAME}/c-1/0"
WORDS: dict[str, tuple[str, ...]] = {
    "init": ("c.vast",),
    "config generate": ("generated",),
    "config view": ("viewed",),
    "config export-configs": ("c", "exported.vast"),
    "config import-configs": ("other.vast",),
    "exec local run": ("--runtime", "process", "--runs", "1", "out"),
    "exec local prepare-run": ("prepared",),
    "exec cluster run": ("--image", "registry/image:1"),
    "exec cluster logs": ("c-1/0",),
    "exec cluster shell": ("c-1/0",),
    "exec cluster debug": ("c-1/0",),
    "exec cluster setup": ("minikube",),
    "exec cluster prepare-setup": ("setup", "--cluster-config", "minikube"),
    "exec cluster prepare-run": ("cluster",),
    "replay": ("camp/c-1/0",),
    "minimise": ("camp/c-1/0",),
    "results query": ("SELECT 1",),
    "results compare": (NAME, NAME),
    "results history": ("c-1",),
    "results report": (NAME,),
    "results coverage": (NAME,),
    "results junit": (NAME, "junit.xml"),
    "results search": (NAME,),
    "results merge-campaigns": ("merged",),
    "results remove-from-share": ("-i", "x"),
    "results import-results": ("absent.tar.gz",),
    "results sparql": ("failed-runs",),
    "evaluation notebook": (f"results/{NAME}",),
    "import-results": ("absent.tar.gz",),
    "view": (RUN,),
    "install-completion": ("bash",),
}
"""Arguments with which a command reaches what it imports late."""
NEEDED = {
    **dict.fromkeys(
        [
            *(f"exec cluster {name}" for name in ("run", "monitor", "logs", "runs", "shell")),
            *(f"exec cluster {name}" for name in ("debug", "cleanup", "stop", "resume", "retry")),
            *(f"exec cluster {name}" for name in ("run-cleanup", "download-cleanup")),
            *("replay", "minimise", "results download"),
        ],
        "cluster",
    ),
    "results query": "query",
    "results sparql": "query",
    "evaluation gui": "gui",
    "evaluation notebook": "notebooks",
    "evaluation mcp-server": "mcp",
    "mcp": "mcp",
    "view": "gui",
}
"""What the user must install, at least, for these commands."""
MESSAGE = re.compile(
    r"error: [A-Z`].* needs the extra `(\w+)` \((\w+) is not installed\)\nhint: "
    r".*pip install .*\[\1\]'?`[.\n]",
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return core_site(tmp_path_factory.mktemp("core") / "site")


@pytest.fixture(scope="module")
def core(site: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[CoreVast]:
    core = CoreVast(site, tmp_path_factory.mktemp("output"))
    yield core
    core.close()


@pytest.fixture
def place(tmp_path: Path) -> Path:
    finished_campaign(tmp_path / "results", 2)
    document = "version: 1\nconfiguration: [{name: c}]\nexecution: {scenario_file: s.osc}\n"
    for name in ("c.vast", "other.vast"):
        (tmp_path / name).write_text(document.replace("name: c", f"name: {name[0]}"))
    (tmp_path / "s.osc").write_text("scenario test:\n    do serial:\n        wait elapsed(0s)\n")
    return tmp_path


@pytest.mark.parametrize("path", leaves())
def test_a_command_works_or_names_its_extra(path: str, core: CoreVast, place: Path) -> None:
    results = ("-V", "c.vast") if path.startswith(("config", "exec")) else ()
    outcome = core.run(*results, *path.split(), *WORDS.get(path, ()), cwd=place)
    assert outcome.returncode not in (1, 70), outcome.stderr
    assert "Traceback" not in outcome.stderr
    if "not installed" in outcome.stderr or path in NEEDED:
        found = MESSAGE.search(outcome.stderr)
        assert found, outcome.stderr
        assert outcome.returncode == 3
        assert found[1] == NEEDED.get(path, found[1])


def test_the_extras_are_those_of_the_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    names = {
        extra: {re.split(r"[<>=\[]", line)[0] for line in lines}
        for extra, lines in project["optional-dependencies"].items()
    }
    assert {extra.name for extra in EXTRAS} == set(names)
    installed = packages_distributions() | {
        package: [own.name for own in distributions() if PurePath(*folder) in (own.files or ())]
        for extra in EXTRAS
        for package in extra.packages
        if "." in package and (folder := (*package.split("."), "__init__.py"))
    }
    for extra in EXTRAS:
        if extra.name != "rerun":  # 790 MB
            of = {name for package in extra.packages for name in installed.get(package, [package])}
            assert {name.lower().replace("_", "-").removesuffix("-slim") for name in of} == names[
                extra.name
            ], extra.name


def test_each_package_that_is_imported_is_of_the_core_or_of_an_extra(site: Path) -> None:
    optional = {name.partition(".")[0] for extra in EXTRAS for name in extra.packages}
    ours = {path.name for path in site.iterdir() if path.is_dir()} | {"rosbags_common", "_typeshed"}
    ours.add("click")  # imported only for a plugin that is made with it
    for path in (path for top in ("src", "cli") for path in (ROOT / top).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [node.module] if isinstance(node, ast.ImportFrom) and node.module else []
            names += [name.name for name in node.names] if isinstance(node, ast.Import) else []
            tops = {name.partition(".")[0] for name in names}
            assert tops <= ours | optional | set(sys.stdlib_module_names), f"{path}:{node.lineno}"


def test_the_web_ui_needs_its_own_extra_alone(tmp_path: Path) -> None:
    site = core_site(tmp_path / "site", "starlette", "uvicorn")
    modules = "robovast.evaluation.server.app, robovast_cli.commands.evaluation.gui"
    done = subprocess.run(
        [
            sys.executable,
            "-S",
            "-I",
            "-c",
            f"import sys; sys.path[:0] = {[str(site)]}; import {modules}",
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr

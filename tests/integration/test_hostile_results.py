"""Results in which the files that everybody opens by name are pipes, links or terabytes large."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from support.campaigns.hostile import KEY, assert_untouched, make_host
from support.campaigns.stored import NAME, write, write_campaign

from robovast_cli.main import command

LIMIT = 300
"""Of one command, on a machine that has other things to do [s]."""
MEMORY = 1 << 20
"""Of one command [KiB]."""
COMMANDS = {
    "postprocess": ["postprocess"],
    "metadata": ["metadata"],
    "merge": ["merge-campaigns", "merged"],
    "publish": ["publish"],
}
FILES = (
    "test.xml",
    "run.json",
    "poses.csv",
    "postprocessing.yaml",
    "sysinfo.yaml",
    "rosbag2/metadata.yaml",
    "rosbag2/a.mcap",
    "rosbag2/b.db3",
    "rosbag2/c.mcap.zstd",
)
OF_JOB = ("logs/system.log", "sysinfo.yaml", "resource_usage_main.csv")
DOCUMENT = """\
version: 1
configuration: [{name: hall}]
execution: {scenario_file: hall.osc, image: robots/hall}
results_processing:
  postprocessing:
  - rosbags_tf_to_csv
  - rosbags_rosout_to_csv
  publication:
  - zip: {overwrite: true}
"""


def make_huge(path: Path) -> None:
    magic = {".mcap": b"\x89MCAP0\r\n", ".db3": b"SQLite format 3\0"}
    with path.open("wb") as file:
        file.write(magic.get(path.suffix, b""))
        file.truncate(3 << 40)


KINDS: dict[str, Callable[[Path, Path], None]] = {
    "pipes": lambda path, host: os.mkfifo(path),
    "links": lambda path, host: path.symlink_to(host / "id_ed25519"),
    "huge": lambda path, host: make_huge(path),
}


@pytest.fixture
def host(tmp_path: Path) -> Iterator[Path]:
    folder = make_host(tmp_path / "host")
    yield folder
    assert_untouched(folder)


@pytest.fixture(params=KINDS)
def results(request: pytest.FixtureRequest, tmp_path: Path, host: Path) -> Path:
    """A campaign of four runs: the first has nothing but such files, the last is a link."""
    campaign = write_campaign(tmp_path / "results")
    (campaign / "_config" / "hall.vast").write_text(DOCUMENT)
    (campaign / "_config" / "hall.osc").write_text("scenario hall:\n    do serial:\n        wait\n")
    folders = ((campaign / "hall-1" / "0", FILES), (campaign / "_jobs" / "job-0", OF_JOB))
    for folder, names in folders:
        for name in names:
            path = folder / name
            path.parent.mkdir(exist_ok=True)
            path.unlink(missing_ok=True)
            KINDS[request.param](path, host)
    shutil.rmtree(campaign / "hall-2" / "1")
    (campaign / "hall-2" / "1").symlink_to(host)
    return tmp_path / "results"


MEASURED = """\
import resource, subprocess, sys
code = subprocess.call(sys.argv[2:])
with open(sys.argv[1], "w") as file:
    file.write(str(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss))
sys.exit(code if code >= 0 else 255)
"""
"""Calls a program from a small process: to a child's memory that of its parent counts, too."""


def vast(results: Path, *words: str) -> subprocess.CompletedProcess[str]:
    program = Path(sys.executable).with_name("vast")
    return subprocess.run(
        [
            sys.executable,
            "-c",
            MEASURED,
            results.parent / "used",
            program,
            "results",
            *words,
            "-r",
            results,
        ],
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
        stdin=subprocess.DEVNULL,
        cwd=results,
    )


def test_every_command_ends_and_reads_nothing_of_the_host(results: Path) -> None:
    for name, words in COMMANDS.items():
        if name == "publish" and (results / NAME / "hall-1/0/test.xml").stat().st_size > 1 << 30:
            continue  # to pack terabytes takes long, rightly
        done = vast(results, *words)
        said = done.stdout + done.stderr
        assert "Traceback" not in said, said
        assert done.returncode < 255, said
        assert KEY not in said
        used = int((results.parent / "used").read_text())
        assert used < MEMORY, f"{name}: {used} KiB"
    metadata = (results / NAME / "metadata.yaml").read_text()
    assert KEY not in metadata
    assert "hall-2/0" in metadata, "the others are there"
    assert "hall-2/1" not in metadata, "a link is no run"
    made = [path for path in results.rglob("*") if path.is_file() and not path.is_symlink()]
    small = [path for path in made if path.stat().st_size < 1 << 24]
    assert not [path for path in small if KEY.encode() in path.read_bytes()]


LINKS = {"long": "x" * 300, "circle": ".", "closed": "closed/file"}
"""Targets of links: a name that no file can have, the link itself, what only root can read."""
OTHERS = (
    ["query", "SELECT count(*) FROM runs"],
    ["sparql", "failed-runs"],
    ["history", "hall-1"],
    ["junit", NAME, "../junit.xml"],
    ["report", NAME, "-o", "../report.html"],
    ["summary", NAME],
    ["compare", NAME, NAME],
    ["coverage", NAME],
)
VARIED = DOCUMENT.replace(
    "{name: hall}",
    "{name: hall, variations: [{ParameterVariationList: {name: speed, values: [1, 2]}}]}",
)
PLACES = {
    "beside": """../another _config/x _config/x.ipynb _config/files/x .running extra _jobs/x
        _jobs/job-0/x.csv _jobs/job-0/logs/x.log _execution/replay.json _execution/search hall-1/x
        hall-1/7 hall-1/_config/x hall-1/0/x.csv hall-1/0/rosbag2 hall-2/0/rosbag2_x""",
    "records": """_config/hall.vast _config/x.vast _config/hall.osc _execution/execution.yaml
        _jobs/job-0 metadata.yaml _transient/configurations.yaml hall-1/_config/config.yaml
        hall-1/0/run.json hall-1/0/test.xml hall-1/0/poses.csv hall-1/0/job""",
    "inputs": "_config",
    "outputs": "_execution _transient hall-1",
    "parts": "_jobs hall-1/0 hall-2/_config",
}


@pytest.mark.parametrize(
    ("kind", "places"),
    [*product(LINKS, ("beside", "records")), *product(["long"], ("inputs", "outputs", "parts"))],
)
def test_links_that_cannot_be_followed_are_no_bug(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any, kind: str, places: str
) -> None:
    results = tmp_path / "results"
    campaign = write_campaign(results)
    (campaign / "_config" / "hall.vast").write_text(VARIED)
    (campaign / "_config" / "hall.osc").write_text("scenario hall:\n    speed: float = 1.0\n")
    write(campaign / "_transient" / "configurations.yaml", "{vast: hall.vast, configs: []}")
    (tmp_path / "closed").mkdir(0)
    for path in map(campaign.joinpath, PLACES[places].split()):
        path.parent.mkdir(exist_ok=True)
        if not path.is_symlink() and path.is_dir():
            shutil.rmtree(path)
        path.unlink(missing_ok=True)
        path.symlink_to(path.name if kind == "circle" else tmp_path / LINKS[kind])
    monkeypatch.chdir(results)
    usual = {0} if places == "beside" else {0, 1, 2, 5}
    for words in [*COMMANDS.values(), *OTHERS]:
        with pytest.raises(SystemExit) as ended:
            command().main(args=["results", *words, "-r", "."], prog_name="vast")
        assert ended.value.code in usual, (words, capsys.readouterr())

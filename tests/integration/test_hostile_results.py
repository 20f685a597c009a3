"""Results in which the files that everybody opens by name are pipes, links or terabytes large."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.campaigns.hostile import KEY, assert_untouched, make_host
from support.campaigns.stored import NAME, write_campaign

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

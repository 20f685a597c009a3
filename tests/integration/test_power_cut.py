"""After a power cut everything is there that was told to be, on a disk that forgets the rest."""

from __future__ import annotations

import io
import subprocess
import sys
import tarfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.campaigns.local import ROOT, Recorder, make_campaign, resume, run, verdicts
from support.faults.power_cut import CAN_CUT_POWER, WHY_NOT, PowerCutDisk, power_cut_disk

from robovast.base.atomic import write_atomically
from robovast.campaign.importing import import_archive
from robovast.campaign.merge import merge_campaigns

pytestmark = pytest.mark.skipif(not CAN_CUT_POWER, reason=WHY_NOT)

NAME = "camp-2026-03-05-121530"
SCENARIO = 'echo "of $1" > "$3/result.txt"; mkdir "$3/a"; touch "$3/a/b"'
PROGRAM = """
import sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from support.campaigns.local import Recorder, run
tell = lambda finished: print(finished.path, flush=True)
run(Path(sys.argv[2]), Path(sys.argv[3]), Recorder(on_finished=tell), runs=3, jobs=1)
"""


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[PowerCutDisk]:
    with power_cut_disk(tmp_path) as made:
        yield made


def cut(disk: PowerCutDisk) -> None:
    disk.cut()
    disk.restart()


def test_the_disk_forgets_what_was_not_synced(disk: PowerCutDisk) -> None:
    (disk.root / "file").write_text("content")
    cut(disk)
    assert not (disk.root / "file").exists()


@pytest.mark.parametrize("runs", [1, 5])
def test_a_finished_run_outlives_a_power_cut(tmp_path: Path, disk: PowerCutDisk, runs: int) -> None:
    path = make_campaign(
        tmp_path / "in", 'echo "of $1" > "$3/result.txt"; mkdir "$3/a"; touch "$3/a/b"'
    )
    command = [sys.executable, "-c", PROGRAM, ROOT / "tests", path, disk.root / "out" / "here"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        told = [process.stdout.readline().strip() for _ in range(runs)]
        disk.cut()
        process.kill()
    disk.restart()

    (campaign,) = (disk.root / "out" / "here").iterdir()
    for finished in told:
        folder = campaign / finished
        assert (folder / "result.txt").read_text() == f"of {finished[4]}\n"
        assert {item.name for item in folder.iterdir()} >= {"a", "job", "run.json", "test.xml"}
        assert (folder / "a" / "b").exists()
    recorder = Recorder()
    resumed = resume(campaign, recorder)
    assert set(verdicts(resumed).values()) == {"passed"}
    assert len(resumed.records) == 9
    assert not set(told) & set(recorder.started)


def test_what_was_imported_written_and_merged_outlives_a_power_cut(
    tmp_path: Path, disk: PowerCutDisk
) -> None:
    archive = tmp_path / f"{NAME}.tar.gz"
    files = {"_config/x.vast": b"version: 1\n", "one/_config/config.yaml": b"", "one/0/a/b": b"x"}
    with tarfile.open(archive, "w:gz") as tar:
        for name, content in files.items():
            info = tarfile.TarInfo(f"{NAME}/{name}")
            info.size = len(content)
            tar.addfile(info, io.BytesIO(content))
    imported = import_archive(archive, disk.root / "of" / "mine")
    write_atomically(disk.root / "project", "text")
    cut(disk)
    assert {name: (imported / name).read_bytes() for name in files} == files
    assert (disk.root / "project").read_text() == "text"

    import_archive(archive, disk.root / "of" / "mine", force=True)
    merged = merge_campaigns([imported], disk.root / "merged" / "m").target
    cut(disk)
    assert {name: (imported / name).read_bytes() for name in files} == files
    assert (merged / "one" / "0" / "a" / "b").read_bytes() == b"x"
    assert not [path.name for path in merged.parent.iterdir() if path.name != "m"]


def test_a_campaign_that_has_ended_outlives_a_power_cut(tmp_path: Path, disk: PowerCutDisk) -> None:
    summary = run(make_campaign(tmp_path / "in", "exit 0"), disk.root / "out")
    cut(disk)
    recorder = Recorder()
    assert set(verdicts(resume(summary.campaign, recorder)).values()) == {"passed"}
    assert recorder.started == []

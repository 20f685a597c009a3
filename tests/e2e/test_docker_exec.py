"""Scripts of postprocessing in a real container, by the `command` plugin and docker_exec.sh."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from support.campaigns.finished import finished_campaign

VAST = Path(sys.executable).with_name("vast")
SCRIPT = """\
import argparse, pathlib, rosbags_common
parser = argparse.ArgumentParser()
parser.add_argument("--provenance-file")
parser.add_argument("folder", type=pathlib.Path)
parser.add_argument("--text")
arguments = parser.parse_args()
for run in sorted(arguments.folder.glob("c-*/[0-9]*")):
    (run / "made.txt").write_text(arguments.text)
    name = run.relative_to(arguments.folder)
    rosbags_common.write_provenance_entry(
        arguments.provenance_file, f"{name}/made.txt", [f"{name}/out.csv"], "made"
    )
"""


@pytest.fixture(autouse=True)
def _docker(docker_daemon, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in docker_daemon.env.items():
        monkeypatch.setenv(name, value)


def campaign_with_script(folder: Path, image: str) -> Path:
    arguments = f"[--image, '{image}', tools/made.py, --text, hi]"
    call = f"  - command: {{script: docker_exec.sh, args: {arguments}}}\n"
    campaign = finished_campaign(folder, 2, call)
    (campaign / "_config/tools/made.py").write_text(SCRIPT)
    return campaign


def postprocess(campaign: Path) -> subprocess.CompletedProcess[str]:
    command = [str(VAST), "results", "postprocess", "-r", str(campaign), "--skip-metadata"]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_script_in_a_container_records_what_it_made(slim_image: str, tmp_path: Path) -> None:
    campaign = campaign_with_script(tmp_path, slim_image)
    done = postprocess(campaign)
    assert done.returncode == 0, done.stderr
    made = campaign / "c-1/1/made.txt"
    assert made.read_text() == "hi"
    assert made.stat().st_uid == os.getuid()
    entry = yaml.safe_load((made.parent / "postprocessing.yaml").read_text())["entries"][0]
    assert (entry["output"], entry["sources"], entry["plugin"]) == (
        "c-1/1/made.txt",
        ["c-1/1/out.csv"],
        "made",
    )


def test_an_incompatible_image_is_refused_before_it_starts(
    wrong_compat_image: str, tmp_path: Path
) -> None:
    campaign = campaign_with_script(tmp_path, wrong_compat_image)
    done = postprocess(campaign)
    assert done.returncode == 1
    assert "is not compatible: image interface version `2` is needed, the image has" in done.stderr
    assert not (campaign / "c-1/0/made.txt").exists()

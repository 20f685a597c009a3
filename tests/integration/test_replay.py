"""`vast replay`: the same run again, and what differs."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import pytest
import yaml
from support.campaigns.local import Recorder, make_campaign, other_environment, resume, run

from robovast.base.errors import InputError
from robovast.campaign.merge import merge_campaigns
from robovast.execution.local import LocalOptions, replay_run
from robovast.execution.local.replay import find_run

VAST = Path(sys.executable).with_name("vast")

NOISY = 'echo "$1,$ROBOVAST_SEED" > "$3/out.csv"\n'
CHANCY = NOISY + "exit $((ROBOVAST_SEED % 2))\n"
FLAKY = NOISY + 'echo "$RANDOM$RANDOM" >> "$3/out.csv"\n'
SEED = "  seed: 7\n"


def replay(folder: Path, *options: str) -> tuple[int, str]:
    """Exit code and what is said, without times and the folder of results."""
    command = [VAST, "replay", folder, *options]
    done = subprocess.run(command, cwd=folder.parents[3], capture_output=True, text=True)
    return done.returncode, done.stdout.partition("\n\n")[2].rpartition("Results:")[0] + done.stderr


def executed(tmp_path: Path, script: str, extra: str = SEED, runs: int = 1) -> Path:
    """The first run of `one-1` of a campaign."""
    made = make_campaign(tmp_path / "in", script, extra)
    return run(made, tmp_path / "out", select="one-1", runs=runs).campaign / "one-1" / "0"


def content(folder: Path) -> dict[str, str]:
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path): sha256(path.read_bytes()).hexdigest() for path in files}


def test_a_replay_has_parameters_seed_and_files_of_the_run_and_leaves_it_as_it_is(
    tmp_path: Path,
) -> None:
    folder = executed(tmp_path, NOISY, "  runs_per_job: 4\n", runs=3).with_name("2")
    shutil.rmtree(tmp_path / "in")
    before = content(folder.parent.parent)
    seed = json.loads((folder / "run.json").read_text())["seed"]
    said = f"one-1/2 (seed {seed}): same verdict (passed), same out.csv.\n"
    assert replay(folder) == (0, said)
    assert content(folder.parent.parent) == before
    (made,) = (tmp_path / "replays").iterdir()
    assert (made / "one-1/2/out.csv").read_text() == f"1,{seed}\n"
    record = yaml.safe_load((made / "_execution/execution.yaml").read_text())
    assert record["replay_of"] == f"{folder.parent.parent.name}/one-1/2"
    assert replay(made / "one-1/2") == (0, said)
    with pytest.raises(InputError, match="which cannot be continued"):
        resume(made)


def test_the_first_difference_is_told_and_ends_with_a_code(tmp_path: Path) -> None:
    folder = executed(tmp_path, NOISY)
    (folder / "out.csv").write_text("1,2\n")
    code, said = replay(folder)
    assert code == 1
    assert "one-1/0 (seed 1311306635) differs: same verdict (passed).\n" in said
    assert "out.csv differs in row 1, column 2: 1311306635 instead of 2\n" in said


def test_the_document_says_what_is_compared_and_an_option_replaces_it(tmp_path: Path) -> None:
    extra = SEED + "  compare: [other.csv]\n"
    folder = executed(tmp_path, FLAKY, extra)
    code, said = replay(folder)
    assert (code, said.count("no output was compared because none matches")) == (0, 1)
    code, said = replay(folder, "--compare", "out.csv")
    assert (code, said.count("out.csv differs in row 2, column 1: ")) == (1, 1)


def test_a_harness_that_gives_one_seed_several_results_is_flaky(tmp_path: Path) -> None:
    code, said = replay(executed(tmp_path, FLAKY, runs=2), "--times", "3")
    assert code == 1
    assert "0 of 3 re-runs have the same result." in said
    assert "Nondeterministic: the same seed gives different results" in said
    assert "hancy" not in said


def test_a_robot_that_fails_with_some_seeds_is_chancy(tmp_path: Path) -> None:
    code, said = replay(executed(tmp_path, CHANCY, runs=5), "--times", "2")
    assert code == 0
    assert (
        "2 of 2 re-runs have the same result.\nDeterministic: the same seed gives the same" in said
    )
    assert (
        "Seed-dependent: the verdict depends on the seed (runs of one-1 with other seeds: " in said
    )


def test_what_has_changed_since_is_not_flaky(tmp_path: Path) -> None:
    folder = executed(tmp_path, NOISY)
    (folder.parent.parent / "_config/files/step.sh").write_text("exit 1\n")
    code, said = replay(folder, "--times", "2")
    assert code == 1
    assert said.count(" instead of passed") == 2
    assert "but not the result of the stored run. Check for changes." in said


def test_a_run_without_a_recorded_seed_says_so(tmp_path: Path) -> None:
    folder = executed(tmp_path, NOISY)
    record = json.loads((folder / "run.json").read_text())
    del record["seed"]
    (folder / "run.json").write_text(json.dumps(record))
    command = [VAST, "replay", folder, "--times", "2"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert "No seed was recorded, so chance can cause differences." in done.stdout
    assert "one-1/0 (no seed): 0 of 2 re-runs have the same result." in done.stdout
    assert "laky" not in done.stdout


def test_what_cannot_be_replayed_is_one_message(tmp_path: Path) -> None:
    folder = executed(tmp_path, NOISY)
    config = folder.parent.parent / "_config"
    assert replay(folder.parent / "9")[1].count("there is no such folder") == 1
    for several in (folder.parent, folder.parent.parent):
        assert f"{several}: is not the folder of one run\n" in replay(several)[1]
        assert f"such as {folder}\n" in replay(several)[1]
    (config / "files/step.sh").rename(tmp_path / "step.sh")
    code, said = replay(folder)
    assert (code, said) == (
        2,
        f"error: {folder}: cannot be replayed, since files of its campaign are gone: "
        "_config/files/step.sh\nhint: put them back, or download the campaign again\n",
    )
    (tmp_path / "step.sh").rename(config / "files/step.sh")
    text = (folder / "run.json").read_text()
    (folder / "run.json").write_text(text.replace('"passed"', '"interrupted"'))
    code, said = replay(folder)
    assert (code, said.count("was interrupted, so that there is nothing to compare")) == (2, 1)
    assert not (tmp_path / "replays").exists()


def test_a_run_of_a_merged_campaign_is_replayed_with_its_own_seed(tmp_path: Path) -> None:
    seeds = {}
    for name in ("1", "2"):
        folder = executed(tmp_path / name, NOISY, f"  seed: {name}\n")
        seeds[name] = json.loads((folder / "run.json").read_text())["seed"]
        shutil.move(folder.parent.parent, tmp_path / f"results/merge-me-2026-01-01-00000{name}")
    merged = merge_campaigns(sorted((tmp_path / "results").iterdir()), tmp_path / "a/merged")
    code, said = replay(merged.target / "one-1" / "1")
    assert (code, f"one-1/1 (seed {seeds['2']}): same verdict" in said) == (0, True)


def test_another_version_is_told_of(tmp_path: Path) -> None:
    folder = executed(tmp_path, NOISY)
    record = folder.parent.parent / "_execution/execution.yaml"
    lines = record.read_text().splitlines()
    changed = ("robovast_version: 0.0.1" if "robovast_version" in line else line for line in lines)
    record.write_text("\n".join(changed) + "\n")
    recorder = Recorder()
    options = LocalOptions(runtime="same")
    replay_run(find_run(folder), tmp_path / "replays", 1, options, recorder)
    assert any(text.endswith(" The stored run used 0.0.1.") for text in recorder.messages)


def test_a_run_is_replayed_in_the_environment_that_executed_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBOVAST_PROCESS_ENV", str(other_environment(tmp_path / "cache")))
    folder = executed(tmp_path, NOISY)
    assert json.loads((folder / "run.json").read_text())["image"] == "process:other"
    monkeypatch.delenv("ROBOVAST_PROCESS_ENV")
    code, said = replay(folder)
    assert (code, said.count("ran in the environment other, which is missing")) == (3, 1)
    assert not (tmp_path / "replays").exists()
    assert "same verdict" in replay(folder, "--runtime", "process")[1]
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    code, said = replay(folder)
    assert (code, "same verdict (passed), same out.csv" in said) == (0, True)


@pytest.mark.parametrize("pattern", ["", ".", "/etc/passwd", "\udcff"])
def test_what_cannot_be_compared_is_refused_before_anything_runs(
    tmp_path: Path, pattern: str
) -> None:
    code, said = replay(executed(tmp_path, NOISY), "--compare", pattern)
    assert (code, said.count("hint: use a glob pattern of files in the run folder")) == (2, 1)
    assert not (tmp_path / "replays").exists()


def test_a_replay_is_kept_out_of_its_campaign_and_files_without_topics_have_none(
    tmp_path: Path,
) -> None:
    folder = executed(tmp_path, NOISY)
    before = content(folder.parent.parent)
    for place in (folder, folder.parent, folder.parent.parent / "deeper"):
        code, said = replay(folder, "--out", str(place))
        assert (code, said.count("which a replay leaves as it is")) == (2, 1)
    code, said = replay(folder, "--compare", "*:/odom")
    assert (code, "same verdict (passed)" in said) == (0, True)
    assert content(folder.parent.parent) == before


def test_a_run_beside_the_working_folder_is_found(tmp_path: Path) -> None:
    folder = executed(tmp_path, NOISY)
    command = [VAST, "replay", "../0", "--out", tmp_path / "replays"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert (done.returncode, "one-1/0 (seed 1311306635): same verdict" in done.stdout) == (0, True)
    done = subprocess.run([VAST, "replay", "."], cwd=folder, capture_output=True, text=True)
    assert (done.returncode, "which a replay leaves as it is" in done.stderr) == (2, True)


def swapped(path: Path, elsewhere: Path) -> None:
    """Put a link to the same content in place of a file or folder."""
    path.rename(elsewhere)
    path.symlink_to(elsewhere)


def sparse(path: Path, _: Path) -> None:
    os.truncate(path, 0)
    os.truncate(path, 2**40)


def piped(path: Path, _: Path) -> None:
    os.mkfifo(path / "pipe")


def test_inputs_that_are_no_plain_files_are_refused(tmp_path: Path) -> None:
    folder = executed(tmp_path, NOISY)
    link, behind = "is a link, which is not followed", "a part of its path is a link, or no folder"
    for number, (place, spoil, why) in enumerate(
        (
            ("_config", swapped, link),
            ("_config/files", swapped, link),
            ("_config/files/step.sh", swapped, link),
            ("_transient", swapped, behind),
            ("_transient/configurations.yaml", swapped, link),
            ("_execution", swapped, behind),
            ("one-1/_config", swapped, link),
            ("one-1/_config/config.yaml", swapped, link),
            ("_config/files/step.sh", sparse, f"{2**40} of its {2**40} bytes were never written"),
            ("_config/files", piped, "is not a regular file"),
        )
    ):
        spoilt = tmp_path / f"spoilt-{number}"
        shutil.copytree(folder.parent.parent, spoilt, symlinks=True)
        spoil(spoilt / place, tmp_path / f"elsewhere-{number}")
        with pytest.raises(InputError, match=f"{place}.*: cannot be an input of a run: {why}"):
            find_run(spoilt / "one-1/0")


def test_a_damaged_record_of_configurations_is_one_message(tmp_path: Path) -> None:
    folder = executed(tmp_path, NOISY)
    path = folder.parent.parent / "_transient/configurations.yaml"
    sound = yaml.safe_load(path.read_text())
    item = sound["configs"][0]
    inside = "must be the path of a file in the campaign's `_config`"
    for change, said in (
        ({"vast": None}, "`vast`: "),
        ({"vast": "/tmp/x.vast"}, f"`vast`: {inside}"),
        ({"vast": "../x.vast"}, f"`vast`: {inside}"),
        ({"configs": [None]}, "`configs[0]`: "),
        ({"configs": [{**item, "_config_files": ["../../x"]}]}, f"_config_files[0]`: {inside}"),
        ({"_input_files": 5}, "`_input_files`: "),
        ({"_run_files": ["/nonexistent/x"]}, f"`_run_files[0]`: {inside}"),
    ):
        path.write_text(yaml.safe_dump({**sound, **change}))
        with pytest.raises(InputError, match=r"configurations.yaml: is damaged: ") as error:
            find_run(folder)
        assert said in str(error.value)
    path.write_text("configs: [{name: one-1, config: {x: &x [*x]}}]\n")
    with pytest.raises(InputError, match="refers to a value that contains the alias"):
        find_run(folder)
    path.write_text("vast: [\n")
    code, text = replay(folder)
    assert (code, text.count("error: ")) == (2, 1)

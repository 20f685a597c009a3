"""The page of a run shows all that it left, and nothing from elsewhere."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from pathlib import Path

import pytest
from support.campaigns.searches import write_search
from support.campaigns.stored import NAME, write, write_campaign

from robovast.base.errors import InputError
from robovast.evaluation.campaign_index import CampaignIndex
from robovast.evaluation.files import list_files
from robovast.evaluation.launch.commands import (
    as_shell,
    more_batches,
    more_runs_words,
    repeat_words,
)
from robovast.evaluation.run import Replay, read_run


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return write_campaign(tmp_path, judge=lambda *_: "failed", runs=1)


def test_a_run_with_everything(root: Path) -> None:
    run = read_run(root.parent, NAME, "hall-1", 0)
    job = f"{NAME}/_jobs/job-0"
    assert run.record["reason"] == "goal not reached: no goal after 20 s"
    assert run.failure == "goal not reached\nno goal after 20 s"
    assert run.logs == [f"{job}/logs/system.log"]
    assert run.usage == [f"{job}/resource_usage_main.csv"]
    assert run.sysinfo["cpu_name"] == "fast"
    assert [file.name for file in run.files] == ["poses.csv", "run.json", "test.xml"]


def test_a_job_with_other_runs_is_told(root: Path) -> None:
    finished = root / "_jobs" / "job-0" / "finished_runs"
    write(finished, "hall-1/0\n")
    assert not read_run(root.parent, NAME, "hall-1", 0).packed
    write(finished, "hall-1/0\nhall-2/0\n")
    assert read_run(root.parent, NAME, "hall-1", 0).packed


def test_the_command_reproduces_the_run_that_is_shown(root: Path) -> None:
    words = shlex.split(read_run(root.parent, NAME, "hall-1", 0).command)
    assert words == ["vast", "replay", f"{root}/hall-1/0", f"--out={root.parent}"]


def test_a_run_without_a_result_has_nothing_to_reproduce(root: Path) -> None:
    write(root / "hall-1" / "0" / "run.json", '{"verdict": "interrupted"}')
    assert read_run(root.parent, NAME, "hall-1", 0).command == ""


def test_the_command_of_a_malicious_campaign_is_one_command(root: Path) -> None:
    place = f"{NAME}/--help; rm -rf ~ $(id)\n`id`/0"
    words = shlex.split(as_shell(repeat_words(root.parent, place, {"verdict": "failed"})))
    assert words == ["vast", "replay", f"{root.parent}/{place}", f"--out={root.parent}"]


def test_a_replay_says_which_run_it_repeats_and_how_it_compares(root: Path) -> None:
    assert read_run(root.parent, NAME, "hall-1", 0).replay is None
    execution = root / "_execution" / "execution.yaml"
    record = execution.read_text()
    for of, stored in ((f"{NAME}/hall-2/0", True), ("gone/hall-2/0", False), ("../../x", False)):
        execution.write_text(f"{record}replay_of: {of}\n")
        assert read_run(root.parent, NAME, "hall-1", 0).replay == Replay(of, stored, None, "")
    write(root / "_execution" / "replay.json", '{"same": false, "text": ["a", "b"]}')
    assert read_run(root.parent, NAME, "hall-1", 0).replay == Replay(of, False, False, "a\nb")
    write(root / "_execution" / "replay.json", '[{"same": 7}')
    assert read_run(root.parent, NAME, "hall-1", 0).replay == Replay(of, False, None, "")


def test_a_run_without_its_job(root: Path) -> None:
    (root / "hall-1" / "0" / "job").unlink()
    write(root / "hall-1" / "0" / "run.json", '{"verdict": "errored"}')
    run = read_run(root.parent, NAME, "hall-1", 0)
    assert (run.job_files, run.logs) == ([], [])


@pytest.mark.parametrize("job", ["../../secrets", "../hall-1/../../secrets", "job-1"])
def test_a_job_outside_the_campaign_is_none(root: Path, job: str) -> None:
    write(root.parent / "secrets" / "logs" / "secret.log", "secret")
    (root / "_jobs" / "job-1").rename(root.parent / "job-1")
    (root / "_jobs" / "job-1").symlink_to(root.parent / "job-1")
    (root / "hall-1" / "0" / "job").unlink()
    (root / "hall-1" / "0" / "job").symlink_to(root.parent / "secrets")
    write(root / "hall-1" / "0" / "run.json", f'{{"verdict": "passed", "job": "{job}"}}')
    assert read_run(root.parent, NAME, "hall-1", 0).job_files == []


def test_links_are_not_listed(root: Path) -> None:
    (root / "hall-1" / "0" / "passwd").symlink_to("/etc/passwd")
    (root / "hall-1" / "0" / "etc").symlink_to("/etc")
    names = [file.name for file in list_files(root.parent, f"{NAME}/hall-1/0")]
    assert names == ["poses.csv", "run.json", "test.xml"]


def test_entities_in_a_test_result_are_not_resolved(root: Path) -> None:
    write(
        root / "hall-1" / "0" / "test.xml",
        '<!DOCTYPE t [<!ENTITY x SYSTEM "file:///etc/passwd">]><t><failure>&x;</failure></t>',
    )
    assert read_run(root.parent, NAME, "hall-1", 0).failure == ""


def test_the_topics_of_a_bag(root: Path) -> None:
    write(
        root / "hall-1" / "0" / "rosbag2" / "metadata.yaml",
        "rosbag2_bagfile_information:\n"
        "  duration: {nanoseconds: 9500000000}\n"
        "  starting_time: {nanoseconds_since_epoch: 1772630684000000000}\n"
        "  topics_with_message_count:\n"
        "  - topic_metadata: {name: /scan, type: sensor_msgs/msg/LaserScan}\n"
        "    message_count: 95\n"
        "  - nonsense\n",
    )
    (bag,) = read_run(root.parent, NAME, "hall-1", 0).bags
    assert (bag.start, bag.duration) == (1772630684, 9.5)
    assert bag.topics == [("/scan", "sensor_msgs/msg/LaserScan", 95)]


@pytest.mark.parametrize("count", ["²", "9" * 400, "9" * 5000])
def test_a_count_that_is_no_number_is_none(root: Path, count: str) -> None:
    write(
        root / "hall-1" / "0" / "rosbag2" / "metadata.yaml",
        f"rosbag2_bagfile_information: {{duration: {{nanoseconds: '{count}'}}}}\n",
    )
    assert [bag.duration for bag in read_run(root.parent, NAME, "hall-1", 0).bags] == [0]


def test_what_postprocessing_made_says_how(root: Path) -> None:
    write(
        root / "hall-1" / "0" / "postprocessing.yaml",
        "entries:\n- output: hall-1/0/poses.csv\n  sources: [hall-1/0/rosbag2]\n"
        "  plugin: rosbags_tf_to_csv\n- nonsense\n",
    )
    (origin,) = read_run(root.parent, NAME, "hall-1", 0).origins
    assert (origin.path, origin.command) == (f"{NAME}/hall-1/0/poses.csv", "rosbags_tf_to_csv")
    assert origin.sources == ["hall-1/0/rosbag2"]


def test_no_such_run(root: Path) -> None:
    with pytest.raises(InputError, match="There is no"):
        read_run(root.parent, NAME, "hall-1", 9)


def test_configurations_of_a_search_get_no_runs_of_their_own(tmp_path: Path) -> None:
    root = write_search(tmp_path / "results", batches=1)
    index = CampaignIndex(root.parent, root.name)
    index.refresh()
    assert more_runs_words(root.parent, index.summary(), ["c1"], 9) == []
    plain = replace(index.summary(), is_search=False)
    assert more_runs_words(root.parent, plain, ["c1"], 9)[-1] == "--runs=9"


def test_a_search_in_a_cluster_gets_more_batches_by_a_patch(tmp_path: Path) -> None:
    record = write_campaign(tmp_path, outputs=False) / "_execution" / "execution.yaml"
    record.write_text(record.read_text().replace("type: local", "type: cluster"))
    index = CampaignIndex(tmp_path, NAME)
    index.refresh()
    *words, patch = shlex.split("8".join(more_batches(tmp_path, index.summary()) or ()))
    assert words == ["kubectl", "patch", "campaign", "NAME", "--type", "merge", "-p"]
    search = {"budget": [{"batches": 8}], "stopping": None}
    assert json.loads(patch) == {"spec": {"vast": {"search": search}}}

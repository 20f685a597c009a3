"""The commands of a .vast file work over all runs of a campaign, and in one pass over a run."""

import inspect
import json
import os
import resource
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from support.campaigns.bags import START, Bag, rows

from robovast.analysis.bags import commands, files
from robovast.analysis.bags.behaviors import BehaviorsWorker
from robovast.analysis.bags.convert import convert_run
from robovast.analysis.bags.jobs import WORKERS
from robovast.base.errors import StorageError
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.model.document.commands import BAG_COMMANDS, BehaviorsToCsv, bag_command

GROUP = "robovast.postprocessing_commands"


def record(run: Path, *texts: str) -> None:
    with Bag(run / "rosbag2") as bag:
        for at, text in enumerate(texts):
            bag.write("/text", bag.make("std_msgs/msg/String", text), at)
        bag.transforms([bag.transform("map", "base_link", 1)])


def record_log(folder: Path, *texts: str) -> None:
    with Bag(folder) as bag:
        for at, text in enumerate(texts):
            stamp = bag.header(at, "").stamp
            log = bag.make("rcl_interfaces/msg/Log", stamp, 20, "node", text, "", "", 1)
            bag.write("/rosout", log, at)


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    folder = tmp_path / "my campaign-2026-03-04-152130"
    record(folder / "one" / "0", "a")
    record(folder / "one" / "10", "b", "c")
    (folder / "two" / "0").mkdir(parents=True)
    (folder / "_config").mkdir()
    return folder


def test_every_command_is_a_plugin_with_the_parameters_of_its_job() -> None:
    found = {point.name: point.load() for point in entry_points(group=GROUP)}
    for name, job in BAG_COMMANDS.items():
        names = set(inspect.signature(found[name]).parameters)
        assert names == {"results_dir", "config_dir", *job.model_fields, "provenance_file"}


def test_all_runs_of_a_campaign_are_worked_on(campaign: Path) -> None:
    success, message, entries = commands.rosbags_to_csv(
        str(campaign), str(campaign / "_config"), topics=["/text"]
    )
    assert success
    assert message.splitlines() == [
        "2 files of 3 runs",
        "two/0: there is no bag: no folder `rosbag2` in it",
    ]
    assert entries == [
        {
            "output": f"one/{run}/rosbag2_text.csv",
            "sources": [f"one/{run}/rosbag2"],
            "plugin": "rosbags_to_csv",
            "params": {"topics": ["/text"]},
        }
        for run in (0, 10)
    ]
    assert [row["data"] for row in rows(campaign / "one/10/rosbag2_text.csv")] == ["b", "c"]


@pytest.mark.parametrize(
    ("below", "outputs"),
    [("one/0", ["poses.csv"]), ("one", ["0/poses.csv", "10/poses.csv"]), ("two/0", [])],
)
def test_a_configuration_or_a_run_can_be_worked_on(
    campaign: Path, below: str, outputs: list[str]
) -> None:
    _, _, entries = commands.rosbags_tf_to_csv(str(campaign / below), str(campaign))
    assert [entry["output"] for entry in entries] == outputs
    assert all((campaign / below / output).is_file() for output in outputs)


def test_a_wrong_parameter_is_a_failure_that_says_so(campaign: Path) -> None:
    success, message, entries = commands.rosbags_tf_to_csv(str(campaign), str(campaign), frames=[])
    assert (success, entries) == (False, [])
    assert "frames" in message


def test_large_campaigns_are_shared_among_processes(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    alone = commands.rosbags_tf_to_csv(str(campaign), str(campaign))
    content = (campaign / "one/0/poses.csv").read_bytes()
    monkeypatch.setattr(commands, "_WORTH_PROCESSES", 0)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _pid: {0, 1})
    assert commands.rosbags_tf_to_csv(str(campaign), str(campaign)) == alone
    assert (campaign / "one/0/poses.csv").read_bytes() == content


def test_all_jobs_share_one_pass_over_a_bag(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    plain_open = files.open_file

    def counting(path: Path) -> object:
        opened.append(path.name)
        return plain_open(path)

    monkeypatch.setattr(files, "open_file", counting)
    jobs = [
        bag_command("rosbags_to_csv", {"topics": ["/text"]}),
        bag_command("rosbags_to_csv", {"topics": ["/tf", "/text"]}),
        bag_command("rosbags_tf_to_csv", {}),
        bag_command("rosbags_bt_to_csv", {}),
    ]
    done = convert_run(campaign / "one" / "0", jobs)
    assert opened == ["rosbag2.mcap"] * 2, "once to scan it, once to read its only chunk"
    assert {output.path.name for output in done.outputs} == {
        "rosbag2_text.csv",
        "rosbag2_tf.csv",
        "poses.csv",
    }


def test_a_damaged_message_counts_once_however_many_jobs_want_it(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.write_raw("/a", "std_msgs/msg/String", b"junk")
    job = bag_command("rosbags_to_csv", {"topics": ["/a"]})
    done = convert_run(tmp_path, [job, job])
    assert [text for text in done.warnings if text.startswith("1 messages on /a")]


def test_nothing_but_complete_files_is_left(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = campaign / "one" / "0"
    before = {path.name for path in run.iterdir()}
    monkeypatch.setitem(WORKERS, BehaviorsToCsv, Interrupting)
    jobs = [bag_command(name, {}) for name in ("rosbags_tf_to_csv", "rosbags_bt_to_csv")]
    with pytest.raises(KeyboardInterrupt):
        convert_run(run, jobs)
    assert {path.name for path in run.iterdir()} == before


class Interrupting(BehaviorsWorker):
    """A worker during which the user presses Ctrl-C."""

    def subscribe(self, topic: object) -> None:
        raise KeyboardInterrupt


def test_a_disk_without_space_is_an_error_about_storage(tmp_path: Path) -> None:
    record(tmp_path, *(["x" * 5000] * 50))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, limits[1]))
    try:
        with pytest.raises(StorageError, match="rosbag2 cannot be converted"):
            convert_run(tmp_path, [bag_command("rosbags_to_csv", {"topics": ["/text"]})])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rosbag2"]


def test_logs_come_from_the_job_where_the_run_has_none(campaign: Path) -> None:
    run = campaign / "one" / "0"
    job = campaign / "_jobs" / "job-0"
    (run / "job").symlink_to("../../_jobs/job-0")
    record_log(job / "logs" / "rosout_bag", "before", "during", "after")
    RunRecord(
        campaign="c",
        variant="one",
        entry="one",
        run=0,
        id=0,
        verdict=Verdict.PASSED,
        reason="",
        started_at="2023-11-14T22:13:20.500000+00:00",
        finished_at="2023-11-14T22:13:21.500000+00:00",
        duration=1.0,
        exit_code=0,
        attempt=1,
        job="job-0",
        runtime="process",
        image="",
        image_digest="",
        host="",
    ).write(run)
    assert START == 1_700_000_000_000_000_000  # 22:13:20 of that day
    _, _, (entry,) = commands.rosbags_rosout_to_csv(str(run), str(campaign))
    assert entry["sources"] == ["job/logs/rosout_bag"]
    assert [row["msg"] for row in rows(run / "rosout.csv")] == ["during"]


def test_a_runs_own_logs_come_first(tmp_path: Path) -> None:
    record_log(tmp_path / "0" / "rosbag2", "own")
    record_log(tmp_path / "0" / "job" / "logs" / "rosout_bag", "of the job")
    commands.rosbags_rosout_to_csv(str(tmp_path), str(tmp_path))
    assert [row["msg"] for row in rows(tmp_path / "0" / "rosout.csv")] == ["own"]


def test_without_its_extra_a_command_fails_alone(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    success, message, _ = commands.rosbags_to_webm(str(campaign), str(campaign))
    assert not success
    assert "pip install" in message
    assert "[video]" in message
    jobs = [bag_command(name, {}) for name in ("rosbags_to_webm", "rosbags_tf_to_csv")]
    done = convert_run(campaign / "one" / "0", jobs)
    assert [job.command for job in done.failures] == ["rosbags_to_webm"]
    assert [output.path.name for output in done.outputs] == ["poses.csv"]


def test_loading_the_plugins_needs_no_extra() -> None:
    script = (
        "import sys\n"
        "for name in ('rosbags', 'mcap', 'numpy', 'orjson', 'av'): sys.modules[name] = None\n"
        "import robovast.analysis.bags.commands as c\n"
        "print(c.rosbags_bt_to_csv('.', '.')[:2])\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert "[ros]" in result.stdout


def test_parameters_are_plain_in_provenance() -> None:
    job = bag_command("rosbags_rosout_to_csv", {"skip_levels": ["warn"], "min_level": 10})
    assert json.dumps(job.model_dump(mode="json", exclude_defaults=True)) == (
        '{"skip_levels": ["WARN"]}'
    )

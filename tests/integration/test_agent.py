"""Pods of a campaign, each as plain processes: the real scripts, real scenarios, a real S3."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from agent_pods import Campaign, Pod
from local_campaigns import make_campaign, run
from robovast_testbed.s3 import Server

PASS = 'echo "$1,$2" > "$3/out.csv"\n'
FAIL_SECOND = PASS + '[ "$1" != 2 ]\n'
PACK = "  runs_per_job: 3\n"

Make = Callable[..., Campaign]


@pytest.fixture
def make(tmp_path: Path, s3_server: Server) -> Iterator[Make]:
    """Makes a campaign; its variants are one-1, one-2 and one-3."""
    made: list[Campaign] = []

    def make(script: str, extra: str = "", **given: object) -> Campaign:
        vast = make_campaign(tmp_path / "source", script, extra)
        made.append(Campaign(tmp_path / "mounts", vast, s3_server, dict(given)))
        return made[-1]

    yield make
    for campaign in made:
        campaign.close()


def test_pods_store_the_files_that_a_laptop_would_have(make: Make, tmp_path: Path) -> None:
    campaign = make(FAIL_SECOND)
    codes = [Pod(campaign).run(index) for index in range(3)]
    assert codes == [0, 10, 0]
    root = run(campaign.vast, tmp_path / "local").campaign
    written = ("_config", "_execution")  # when the campaign ends
    local = {
        path.relative_to(root).as_posix()
        for path in root.rglob("*")
        if path.is_file() and not path.is_symlink() and "job" not in path.relative_to(root).parts
    }
    runs = {name for name in local if name.split("/")[1].isdigit() or name.startswith("_jobs/")}
    assert runs <= set(campaign.objects())
    assert set(campaign.objects()) <= local, written
    record = campaign.record("one-2/0")
    assert (record["verdict"], record["job"], record["id"]) == ("failed", "job-1", 1)
    assert (record["attempt"], record["parameters"]) == (1, {"x": 2})


def test_a_pack_is_one_pod(make: Make) -> None:
    campaign = make(FAIL_SECOND, PACK)
    pod = Pod(campaign)
    assert pod.run() == 10, pod.log("agent")
    assert pod.message() == {"passed": "0,2", "failed": "1", "errored": ""}
    assert campaign.verdicts() == {"one-1/0": "passed", "one-2/0": "failed", "one-3/0": "passed"}
    assert campaign.read("one-3/0/out.csv") == "3,a\n"
    assert campaign.read("_transient/job-0.params.yaml").count("_output_dir") == 3


def test_a_run_that_kills_its_process_is_errored_and_the_others_go_on(make: Make) -> None:
    campaign = make(PASS + 'if [ "$1" = 2 ]; then kill -9 $PPID; fi\n', PACK)
    pod = Pod(campaign)
    assert pod.run() == 11, pod.log("agent")
    assert pod.message() == {"passed": "0,2", "failed": "", "errored": "1"}
    assert campaign.read("one-2/0/out.csv") == "2,a\n", "partial output is kept"
    assert "SIGKILL" in campaign.record("one-2/0")["reason"]
    jobs = [campaign.record(f"one-{n}/0")["job"] for n in (1, 2, 3)]
    assert jobs == ["job-0", "job-0", "job-0-2"]
    assert "_jobs/job-0/logs/system.log" in campaign.objects()
    assert "_jobs/job-0-2/logs/system.log" in campaign.objects()

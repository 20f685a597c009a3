"""What a Campaign's status means: whether it is over, its exit code, what is told."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from support.kube.fake_cluster import accepted

from robovast.base.errors import ExitCode, InputError
from robovast_cli.kube.status import CampaignState, find_campaign
from robovast_cli.ui.cluster_view import CampaignLines, LiveCampaigns, line, table


def campaign(name: str = "drive-x", generation: int = 2, **status: Any) -> CampaignState:
    runs = {"total": 10} | status.pop("runs", {})
    return CampaignState(
        {
            "metadata": {"name": name, "generation": generation},
            "spec": {"vast": {}},
            "status": {"observedGeneration": 2, "state": "Running", "runs": runs, **status},
        }
    )


def condition(kind: str, status: str, message: str) -> dict[str, Any]:
    return {"type": kind, "status": status, "reason": "Because", "message": message}


def test_a_campaign_that_nobody_has_seen_is_not_over() -> None:
    new = CampaignState({"metadata": {"name": "x", "generation": 1}, "spec": {"vast": {}}})
    assert not new.finished
    assert new.counts() == "0 of 0 done"


def test_a_status_about_an_older_spec_says_nothing_of_the_end() -> None:
    assert campaign(state="Finished").finished
    assert not campaign(state="Finished", generation=3).finished


@pytest.mark.parametrize(
    ("state", "runs", "conditions", "code"),
    [
        ("Finished", {"passed": 10}, [], ExitCode.OK),
        ("Finished", {"passed": 8, "failed": 1, "errored": 1}, [], ExitCode.TEST_FAILED),
        ("Finished", {"passed": 9, "errored": 1}, [], ExitCode.RUN_ERRORED),
        ("Finished", {"passed": 9}, [], ExitCode.RUN_ERRORED),
        ("Failed", {}, [], ExitCode.CANNOT_RUN),
        ("Failed", {"passed": 3}, [], ExitCode.RUN_ERRORED),
        ("Failed", {}, [condition("Accepted", "False", "no")], ExitCode.BAD_INPUT),
    ],
)
def test_exit_codes_are_those_of_local_campaigns(
    state: str, runs: dict[str, int], conditions: list[dict[str, Any]], code: ExitCode
) -> None:
    assert campaign(state=state, runs=runs, conditions=conditions).exit_code == code


def test_what_hinders_a_campaign_is_told_once() -> None:
    conditions = [
        condition("Accepted", "False", "the document is wrong"),
        condition("Stalled", "True", "the document is wrong"),
        condition("QuotaReserved", "False", "the queue is full"),
        condition("Succeeded", "Unknown", "it runs"),
    ]
    assert campaign(conditions=conditions[2:]).messages == ["the queue is full"]
    rejected = campaign(state="Rejected", conditions=conditions)
    assert rejected.messages == ["the document is wrong"]
    assert rejected.finished


def test_a_rejected_edit_does_not_end_a_campaign_whose_runs_continue() -> None:
    conditions = [condition("Accepted", "False", "spec.vast has changed")]
    found = campaign(runs={"passed": 3, "active": 2}, conditions=conditions)
    assert not found.finished
    assert found.pods() == ["2 running"]
    assert "spec.vast has changed" in found.messages


def test_the_time_left_follows_from_the_pace() -> None:
    status = {"startTime": "2026-01-01T00:00:00Z", "runs": {"passed": 4}}
    now = datetime(2026, 1, 1, 0, 1, tzinfo=UTC)
    assert campaign(**status).left(now) == pytest.approx(90)
    assert campaign().left(now) is None
    over = campaign(**status | {"state": "Finished", "completionTime": "2026-01-01T00:00:30Z"})
    assert (over.elapsed(now), over.left(now)) == (30, None)


def test_the_summary_names_bad_runs() -> None:
    lines = list(
        campaign(
            state="Finished",
            runs={"passed": 7, "failed": 2, "errored": 1},
            failing=["hall-1/0", "hall-2/3"],
        ).summary()
    )
    assert lines == [
        "unsuccessful: hall-1/0",
        "unsuccessful: hall-2/3",
        "… and 1 more unsuccessful runs.",
        "10 of 10 done: 7 passed, 2 failed, 1 errored.",
    ]


def test_lines_are_printed_for_news_alone(capsys: pytest.CaptureFixture[str]) -> None:
    lines = CampaignLines()
    for passed in (0, 0, 1, 1, 5):
        lines.update([campaign(runs={"total": 1000, "passed": passed})])
    assert len(capsys.readouterr().out.splitlines()) == 1
    for passed in (10, 11, 20):
        lines.update([campaign(runs={"total": 1000, "passed": passed})])
    assert len(capsys.readouterr().out.splitlines()) == 2


def test_table_and_bars_show_every_campaign() -> None:
    from rich.console import Console

    both = [
        campaign("one", runs={"passed": 5, "active": 3, "waiting": 2}),
        campaign("two", conditions=[condition("Stalled", "True", "no image")]),
    ]
    text = table(both)
    assert text.splitlines()[0].split()[6:8] == ["RUNNING", "WAITING"]
    assert text.splitlines()[1].split()[:8] == ["one", "Running", "5/10", *"50032"]
    assert "two: no image" in text
    view = LiveCampaigns()
    view.update(both)
    console = Console(width=120, force_terminal=False)
    with console.capture() as capture:
        console.print(view.render())
    assert "5 passed  3 running  2 waiting" in capture.get()
    assert "two: no image" in capture.get()
    assert line(both[0]) == "one  Running  5 of 10 done: 5 passed; 3 running, 2 waiting"
    assert line(both[1]) == "two  Running  0 of 10 done\n    no image"


def test_a_campaign_is_found_by_the_name_of_its_results() -> None:
    known = [campaign("one", campaign="drive-2026-01-01-000000"), campaign("two")]
    assert find_campaign(known, "two", "ns").name == "two"
    assert find_campaign(known, "drive-2026-01-01-000000", "ns").name == "one"
    with pytest.raises(InputError, match="one, two"):
        find_campaign(known, "three", "ns")


def test_of_campaigns_of_one_second_one_must_be_named() -> None:
    twins = [campaign(name, campaign="drive-2026-01-01-000000") for name in ("one", "two")]
    with pytest.raises(InputError, match="Name one of them: one, two"):
        find_campaign(twins, "drive-2026-01-01-000000", "ns")
    assert find_campaign(twins, "one", "ns").name == "one"


@pytest.mark.parametrize(
    ("state", "passed", "code"),
    [
        ("Finished", "True", ExitCode.OK),
        ("Finished", "False", ExitCode.RUN_ERRORED),
        ("Failed", "False", ExitCode.RUN_ERRORED),
    ],
)
def test_failed_runs_are_what_a_search_looks_for(state: str, passed: str, code: ExitCode) -> None:
    found = {
        "batch": 3,
        "criteria": "batches 3/3",
        "best": "failure_rate 0.75",
        "stop": "batches",
        "stopReason": "batches: batches 3/3",
    }
    runs = {"passed": 3, "failed": 7, "stored": 10}
    conditions = [condition("Passed", passed, "")]
    made = campaign(state=state, runs=runs, search=found, failing=["c1/0"], conditions=conditions)
    assert made.exit_code is code
    assert list(made.summary()) == [
        "The search stopped: batches: batches 3/3.",
        "Best: failure_rate 0.75",
        "10 of 10 done: 3 passed, 7 failed; batches 3/3 | best failure_rate 0.75.",
    ]
    assert "drive-x: batches 3/3 | best failure_rate 0.75" in table([made])
    assert "batches 3/3 | best failure_rate 0.75" in line(made)
    assert campaign(search=found, startTime="2026-01-01T00:00:00Z").left(datetime.now(UTC)) is None


def test_of_many_campaigns_a_message_names_the_newest() -> None:
    known = [campaign(f"drive-{number}") for number in range(12)]
    with pytest.raises(InputError) as caught:
        find_campaign(known, "hall", "lab")
    assert "it has drive-2, drive-3, " in str(caught.value)
    assert "drive-11, and 2 older ones (`vast exec cluster monitor --once`)" in str(caught.value)
    with pytest.raises(InputError, match=r"it has drive-0, drive-1\. Name a"):
        find_campaign(known[:2], "hall", "lab")


@pytest.mark.parametrize(("minutes", "old"), [(1, False), (9, False), (11, True), (600, True)])
def test_an_old_status_gives_its_age_and_no_estimate(minutes: int, old: bool) -> None:
    moment = datetime.now(UTC)
    found = campaign(runs={"passed": 5}, startTime=(moment - timedelta(hours=11)).isoformat())
    written = (moment - timedelta(minutes=minutes)).isoformat()
    fields = [{"subresource": "status", "time": written}, {"time": moment.isoformat()}]
    meta = {**found.resource["metadata"], "managedFields": fields}
    found = CampaignState({**found.resource, "metadata": meta})
    assert (found.left(moment) is None) is old
    assert (
        any(f"more than {minutes // 10 * 10} min old" in message for message in found.messages)
        is old
    )
    finished = CampaignState(
        {**found.resource, "status": {"observedGeneration": 2, "state": "Finished"}}
    )
    assert not finished.messages


@pytest.mark.parametrize("title", [None, "Night run, 3rd", "n" * 80])
@pytest.mark.parametrize("prefix", ["", "lab-"])
def test_a_bucket_is_known_without_a_status(title: str | None, prefix: str) -> None:
    made = accepted(storage={"prefix": prefix} if prefix else {})
    vast = made.vast.model_copy(update={"metadata": {"name": title} if title else {}})
    wanted = replace(made, vast=vast)
    identity = wanted.identity
    meta = {
        "name": identity.name,
        "uid": identity.uid,
        "creationTimestamp": identity.created,
        "generation": 1,
    }
    spec = {"vast": {"metadata": vast.metadata}, "storage": {"prefix": prefix} if prefix else {}}
    found = CampaignState({"metadata": meta, "spec": spec})
    assert (found.folder, found.bucket) == (wanted.campaign, wanted.bucket)
    refused = condition("Accepted", "False", "the document is wrong")
    assert campaign(conditions=[refused]).bucket == ""
    kept = campaign(conditions=[refused], bucket="b", campaign="c")
    assert (kept.bucket, kept.folder) == ("b", "c")

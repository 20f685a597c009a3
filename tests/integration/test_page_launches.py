"""Campaigns that are started from the page: as `vast` runs them, and by its user alone."""

from __future__ import annotations

import json
import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlencode

import pytest
from support.campaigns.local import make_campaign
from support.campaigns.stored import NAME, write_campaign
from support.patience import PATIENCE, eventually
from support.servers.page import ShownPage, shown

FAIL_SECOND = 'echo "no goal for $1"; [ "$1" != 2 ]\n'
SLOW = "sleep 600\n"
QUICK = {"runtime": "process"}


@contextmanager
def started_in(folder: Path, *options: str, **settings: Any) -> Iterator[ShownPage]:
    """The page of the results folder in `folder`, of a server that was started there."""
    (folder / "results").mkdir(exist_ok=True)
    with shown(folder / "results", *options, cwd=folder, **settings) as page:
        yield page


@contextmanager
def events(page: ShownPage) -> Iterator[Iterator[dict[str, Any]]]:
    """What the server tells of campaigns that were started from the page."""
    host, _, port = page.address.split("/")[2].partition(":")
    with socket.create_connection((host, int(port)), PATIENCE) as connection:
        request = f"GET {page.base}api/events HTTP/1.1\r\nHost: localhost\r\n\r\n"
        connection.sendall(request.encode())
        lines = iter(connection.makefile("r"))
        told = (next(lines) for line in lines if line == "event: launch\n")
        yield (json.loads(line.removeprefix("data: ")) for line in told)


def ended(page: ShownPage) -> tuple[dict[str, Any], list[str]]:
    """The task when it has ended, and all that it printed."""
    lines: list[str] = []
    with events(page) as told:
        for news in told:
            lines += news["lines"]
            if news["launch"]["ended"]:
                return news["launch"], lines
    raise AssertionError("the server told of no end")


def start(page: ShownPage, **choices: str) -> Any:
    return page.post(f"api/start?{urlencode(QUICK | choices)}")


def running(folder: Path) -> bool:
    return any((folder / "results").glob("*/.running/job-*/out/*"))


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a document whose second configuration fails."""
    folder = tmp_path_factory.mktemp("project")
    make_campaign(folder / "in", FAIL_SECOND)
    for path in (folder / "in").iterdir():
        path.rename(folder / path.name)
    return folder


@pytest.fixture(scope="module")
def page(project: Path) -> Iterator[ShownPage]:
    with started_in(project) as page:
        yield page


def test_what_a_document_expands_to_is_shown_before(page: ShownPage, project: Path) -> None:
    offer = page.get("api/offer").data
    assert (offer["document"], offer["runs"]) == (str(project / "test.vast"), 1)
    variants = page.post("api/expansion").data
    assert variants == {
        "name": ["one-1", "one-2", "one-3"],
        "entry": ["one", "one", "one"],
        "values": {"x": [1, 2, 3]},
    }


def test_a_campaign_is_run_watched_and_given_more_runs(page: ShownPage) -> None:
    launch = start(page, config="one-[12]", runs="1", jobs="2").data
    assert "'--config=one-[12]' --runs=1 --jobs=2 --runtime=process" in launch["command"]
    end, lines = ended(page)
    assert (end["number"], end["code"]) == (launch["number"], 1)
    assert "2 runs: 1 passed, 1 failed." in lines
    (name,) = page.get("api/campaigns").data["campaigns"]
    assert f"Results: results/{name}" in lines

    assert (end["campaign"], end["makes"], end["run"], end["error"]) == ("", name, "", "")

    asked = f"campaigns/{name}/more?config=one-1&config=one-2"
    more = page.get(f"api/{asked}").data
    assert more["planned"] == 1
    launch = page.post(f"api/more?campaign={name}&config=one-2&runs=3").data
    assert launch["command"] == f"{more['command']} --config=one-2 --runs=3"
    assert launch["campaign"] == name
    end, lines = ended(page)
    assert (end["number"], end["code"]) == (launch["number"], 1)
    assert "3 runs: 3 failed." in lines
    siblings = page.get(f"api/campaigns/{name}/one-2/2").data["siblings"]
    assert [number for number, *_ in siblings] == [0, 1, 2]
    assert page.get(f"api/{asked}").data["planned"] == 3
    for wrong in ("config=two-1&runs=3", "config=one-2", "config=--output=x&runs=3"):
        assert page.post(f"api/more?campaign={name}&{wrong}").status == 404


def test_the_run_that_is_shown_is_reproduced_and_compared(tmp_path: Path) -> None:
    """The third run, whose seed is another one than that of the first."""
    script = 'echo "$ROBOVAST_SEED" > "$3/seed.csv"; exit $((ROBOVAST_SEED % 2))\n'
    make_campaign(tmp_path / "in", script, "  seed: 7\n")
    with started_in(tmp_path, "-o", "in/test.vast") as page:
        start(page, config="one-1", runs="6")
        first, _ = ended(page)
        name = first["makes"]
        for number in (2, 5):
            run = f"one-1/{number}"
            before = page.get(f"api/campaigns/{name}/{run}").data
            assert before["details"]["replay"] is None
            page.post(f"api/repeat?campaign={name}&variant=one-1&run={number}")
            end, lines = ended(page)
            assert f"$ {end['command']}" == f"$ {before['details']['command']}"
            assert (end["campaign"], end["run"], end["code"]) == (name, run, 0)
            assert end["makes"].startswith("test-campaign-replay-")
            assert end["makes"] != name
            after = page.get(f"api/campaigns/{end['makes']}/{run}").data
            for key in ("seed", "verdict", "runtime", "image", "parameters"):
                assert after["details"]["record"][key] == before["details"]["record"][key]
            seed, verdict = (before["details"]["record"][key] for key in ("seed", "verdict"))
            said = f"{run} (seed {seed}): same verdict ({verdict}), same seed.csv."
            assert after["details"]["replay"] == {
                "of": f"{name}/{run}",
                "stored": True,
                "same": True,
                "text": said,
            }
            assert said in lines


def test_a_replay_that_is_refused_says_why(tmp_path: Path) -> None:
    make_campaign(tmp_path / "in", FAIL_SECOND)
    with started_in(tmp_path, "-o", "in/test.vast") as page:
        start(page, config="one-1")
        name = ended(page)[0]["makes"]
        (tmp_path / "results" / name / "_transient" / "configurations.yaml").unlink()
        page.post(f"api/repeat?campaign={name}&variant=one-1&run=0")
        end, lines = ended(page)
        assert (end["code"], end["makes"]) == (2, "")
        assert end["error"].startswith("error: ")
        assert "configurations.yaml" in end["error"]
        assert set(end["error"].splitlines()) <= set(lines)


def test_a_launch_has_its_own_campaign_although_its_output_names_others(tmp_path: Path) -> None:
    """Postprocessing names all campaigns, a newer one included."""
    make_campaign(tmp_path / "in", 'printf "a\\n1\\n" > "$3/numbers.csv"\n')
    with started_in(tmp_path, "-o", "in/test.vast", postprocess=True) as page:
        made = []
        for _ in range(2):
            start(page, config="one-1", runs="1")
            made.append(ended(page)[0]["makes"])
        assert sorted(made) == sorted(page.get("api/campaigns").data["campaigns"])
        more = page.post(f"api/more?campaign={made[0]}&config=one-1&runs=2").data
        assert more["makes"] == made[0]
        end, lines = ended(page)
        assert end["makes"] == made[0]
        assert any(made[1] in line for line in lines)


@pytest.mark.parametrize("pattern", ["--output=/etc", "one-1 --runs=9", "$(id)"])
def test_a_pattern_is_a_pattern_whatever_it_looks_like(page: ShownPage, pattern: str) -> None:
    launch = start(page, config=pattern).data
    end, lines = ended(page)
    assert (end["number"], end["code"]) == (launch["number"], 2)
    assert lines[0].startswith(f"error: no configuration matches `{pattern}` (3 available)")


@pytest.mark.parametrize(
    "choices",
    [
        {"runtime": "--image=x"},
        {"runs": "0"},
        {"runs": "1 --output=/etc"},
        {"jobs": "-1"},
        {"config": "a\n--output=/etc"},
        {"config": "a\0"},
    ],
)
def test_what_is_no_choice_is_refused(page: ShownPage, choices: dict[str, str]) -> None:
    answer = start(page, **choices)
    assert answer.status == 404
    assert answer.body


@pytest.mark.parametrize("what", ["start?runtime=process", "expansion", "stop", "repeat", "more"])
def test_another_site_starts_and_stops_nothing(page: ShownPage, what: str) -> None:
    path = f"api/{what}"
    assert page.post(path, Origin="http://evil.example").status == 403
    assert page.post(path, Origin=None).status == 405
    assert page.post(path, Host="evil.example").status == 421
    assert page.get(path).status == 405
    assert page.ask(f"/wrong/{path}", {"Origin": "http://127.0.0.1"}, "POST").status in {403, 405}


@pytest.mark.parametrize(
    ("campaign", "variant"), [("..", "in"), ("none", "one-1"), ("", ""), ("/etc", "passwd")]
)
def test_what_was_not_executed_is_not_repeated(
    page: ShownPage, campaign: str, variant: str
) -> None:
    answer = page.post(f"api/repeat?campaign={quote(campaign)}&variant={quote(variant)}&run=0")
    assert answer.status == 404


def test_one_campaign_at_a_time_and_stop_ends_it(tmp_path: Path) -> None:
    make_campaign(tmp_path / "in", SLOW)
    with started_in(tmp_path, "-o", "in/test.vast") as page:
        start(page, jobs="1")
        refused = start(page)
        assert refused.status == 409
        assert refused.data["error"].startswith("A campaign is being run from this page")
        eventually(lambda: running(tmp_path))
        page.post("api/stop")
        end, lines = ended(page)
        assert (end["code"], end["stopping"]) == (130, True)
        assert any(line.startswith("Continue: vast exec local run --resume") for line in lines)
        (summary,) = page.get("api/campaigns").data["campaigns"].values()
        assert summary["state"] == "incomplete"


def test_more_runs_are_counted_from_those_that_are_planned(tmp_path: Path) -> None:
    root = write_campaign(tmp_path / "results", variants=[{"x": 1}, {"x": 2}], runs=3)
    record = root / "_execution" / "execution.yaml"
    record.write_text(f"{record.read_text()}more_runs: {{hall-2: 13}}\n")
    with started_in(tmp_path) as page:
        asked = f"api/campaigns/{NAME}/more"
        assert page.get(f"{asked}?config=hall-1").data["planned"] == 3
        assert page.get(f"{asked}?config=hall-1&config=hall-2").data["planned"] == 13
        assert page.get(asked).data["planned"] == 0


def test_more_runs_of_a_campaign_of_a_cluster_are_for_kubectl(tmp_path: Path) -> None:
    root = write_campaign(tmp_path / "results", variants=[{"x": 1}, {"x": 2}], runs=3)
    record = root / "_execution" / "execution.yaml"
    record.write_text(record.read_text().replace("local", "cluster"))
    with started_in(tmp_path) as page:
        data = page.get(f"api/campaigns/{NAME}/more?config=hall-2").data
        assert (data["command"], data["planned"], data["cluster"]["of_all"]) == ("", 3, False)
        command = "10".join(data["cluster"]["parts"])
        assert '"name": "hall-2-more", "parameters": [{"x": 2}], "runs": 10' in command
        query = urlencode({"campaign": NAME, "config": "hall-2", "runs": 13})
        assert page.post(f"api/more?{query}").status == 404


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_a_server_that_ends_stops_what_it_runs(tmp_path: Path, end: signal.Signals) -> None:
    make_campaign(tmp_path / "in", SLOW)
    with started_in(tmp_path, "-o", "in/test.vast", end=end) as page:
        start(page, jobs="1")
        eventually(lambda: running(tmp_path))
    assert not running(tmp_path)
    (record,) = (tmp_path / "results").glob("*/one-1/0/run.json")
    assert json.loads(record.read_text())["verdict"] == "interrupted"


def test_a_document_that_is_wrong_is_told_as_the_command_line_tells_it(tmp_path: Path) -> None:
    (tmp_path / "wrong.vast").write_text("version: 1\nconfiguration: 7\n")
    with started_in(tmp_path) as page:
        said = page.post("api/expansion").data["error"]
        assert "wrong.vast:2:" in said
        assert "error: " in said.splitlines()[-1]
        start(page)
        end, lines = ended(page)
        assert (end["code"], lines) == (2, said.splitlines())


def test_where_nothing_can_be_started_the_page_says_why(tmp_path: Path) -> None:
    with started_in(tmp_path) as page:
        offer = page.get("api/offer").data
        assert offer["document"] is None
        assert offer["repeat"]
        assert "no .vast file found in this folder" in offer["refusal"]
        for what in ("start", "expansion"):
            assert page.post(f"api/{what}").data == {"error": offer["refusal"]}


def test_a_page_that_only_shows_starts_nothing(tmp_path: Path) -> None:
    write_campaign(tmp_path / "results", outputs=False)
    make_campaign(tmp_path / "in", FAIL_SECOND)
    with started_in(tmp_path, "--no-start", "-o", "in/test.vast") as page:
        offer = page.get("api/offer").data
        assert (offer["document"], offer["repeat"]) == (None, False)
        assert "only shows results" in offer["refusal"]
        repeat = f"repeat?campaign={NAME}&variant=hall-1&run=0"
        more = f"more?campaign={NAME}&config=hall-1&runs=9"
        for what in ("start", "expansion", repeat, more):
            assert page.post(f"api/{what}").data == {"error": offer["refusal"]}
        assert [path.name for path in (tmp_path / "results").iterdir()] == [NAME]


def test_tables_are_made_when_the_campaign_has_ended(tmp_path: Path) -> None:
    make_campaign(tmp_path / "in", 'printf "a,b\\n1,2\\n" > "$3/numbers.csv"\n')
    with started_in(tmp_path, "-o", "in/test.vast", postprocess=True) as page:
        start(page, config="one-1")
        end, _ = ended(page)
        assert end["code"] == 0
        (name,) = page.get("api/campaigns").data["campaigns"]
        metrics = page.get(f"api/campaigns/{name}/metrics").data
        assert metrics == {"columns": {"numbers": ["a", "b"]}, "same": {"numbers": ["a", "b"]}}

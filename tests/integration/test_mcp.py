"""An assistant's client reads results over stdio and HTTP, and nothing else."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from subprocess import PIPE
from typing import Any
from urllib.parse import urlsplit

import pytest
from support.campaigns.finished import NAME as TABLED
from support.campaigns.finished import finished_campaign
from support.campaigns.stored import NAME, write, write_campaign
from support.patience import PATIENCE
from support.servers.mcp_client import VAST, Assistant, Refusal, over_http, over_stdio, session

from robovast.base.errors import InputError
from robovast.mcp import question

SECRET = "not for everyone"
INITIALIZE = {
    "jsonrpc": "2.0",
    "id": 1,
    "method": "initialize",
    "params": {
        "protocolVersion": "2025-06-18",
        "capabilities": {},
        "clientInfo": {"name": "t", "version": "1"},
    },
}
PLUGIN = '''
from fastmcp import FastMCP

class MyMCPPlugin:
    @property
    def name(self) -> str:
        return "my_plugin"

    def register(self, mcp: FastMCP) -> None:
        @mcp.tool()
        def my_tool() -> str:
            """A custom tool."""
            return "hello"

        @mcp.tool()
        def chatter() -> str:
            """Says too much."""
            return "x" * 1_000_000

class Broken:
    name = "broken"

    def register(self, mcp: FastMCP) -> None:
        @mcp.tool()
        def half() -> str:
            return "half"
        raise ValueError("no licence")
'''


def judge(parameters, number) -> str:
    return "failed" if parameters["speed"] > 1 else "passed"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One campaign with logs and links that lead out, one with tables and provenance."""
    folder = tmp_path_factory.mktemp("asked") / "results"
    root = write_campaign(folder, judge=judge)
    write(folder.parent / "secret", SECRET)
    run = root / "hall-1" / "0"
    (run / "secret.txt").symlink_to(folder.parent / "secret")
    (run / "outside").symlink_to(folder.parent)
    write(run / "long.txt", "0123456789" * 5000)
    (run / "film.webm").write_bytes(bytes(range(256)))
    campaign = finished_campaign(folder, 4)
    command = [VAST, "results", "postprocess", "-r", campaign]
    subprocess.run(command, check=True, capture_output=True)
    return folder


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A distribution with a plugin as the guide shows it, and with one that fails."""
    site = tmp_path_factory.mktemp("site")
    write(site / "my_package" / "mcp_plugin.py", PLUGIN)
    info = site / "my_package-1.0.dist-info"
    write(info / "METADATA", "Metadata-Version: 2.1\nName: my_package\nVersion: 1.0\n")
    write(
        info / "entry_points.txt",
        "[robovast.mcp_plugins]\n"
        "missing = my_package.nothing:Nothing\n"
        "broken = my_package.mcp_plugin:Broken\n"
        "my_plugin = my_package.mcp_plugin:MyMCPPlugin\n",
    )
    return site


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the server prints to standard error."""
    return tmp_path_factory.mktemp("log") / "stderr"


@pytest.fixture(scope="module")
def assistant(results: Path, site: Path, log: Path) -> Iterator[Assistant]:
    with session(over_stdio(results, log, PYTHONPATH=str(site))) as assistant:
        yield assistant


def test_a_failing_run_is_found_and_explained(assistant: Assistant) -> None:
    campaigns = assistant.call("list_campaigns")
    assert campaigns == {"campaigns": [NAME, TABLED], "total": 2}
    where = assistant.call("inspect_campaign", campaign=NAME)
    rates = {item["value"]: item["not_passed"] for item in where["by_factor"]["speed"]}
    assert rates == {"1.0": 0, "2.0": 2}
    low, high = where["by_factor"]["speed"][1]["interval"]
    assert 0.3 < low < 0.4
    assert high == 1
    causes = [(one["cause"], one["verdicts"], one["runs"]) for one in where["causes"]]
    assert causes == [("goal not reached: no goal after 20 s", ["failed"], 2)]
    failed = assistant.call("search_runs", campaign=NAME, verdict="failed", reason="GOAL")
    assert failed["total"] == 2
    place = {"configuration": failed["runs"][0]["configuration"], "run": 0}
    run = assistant.call("get_run", campaign=NAME, **place)
    assert run["record"]["verdict"] == "failed"
    assert run["command"].startswith("vast replay ")
    log = assistant.call("search_run_log", path=run["logs"][0], levels=["error"])
    assert "goal not reached" in log["lines"][0][2]
    poses = assistant.call("get_run_data", path=f"{NAME}/hall-2/0/poses.csv")
    assert poses["total"] == 200
    assert "one row in 2" in poses["cut"]
    same = assistant.call("inspect_campaign_comparison", before=NAME, after=NAME)
    assert same["changes"] == {"same": 2}
    past = assistant.call("get_configuration_history", campaign=NAME, configuration="hall-2")
    assert [(one["campaign"], one["rate"]["failed"]) for one in past["entries"]] == [(NAME, 2)]
    assert past["pending"] == 0
    assert NAME in assistant.prompt("explain_failures", campaign=NAME)


def test_tables_are_queried_and_no_other_file(results: Path, assistant: Assistant) -> None:
    listed = assistant.call("list_run_data_tables")
    assert {"runs", "out"} <= {table["table"] for table in listed["tables"]}
    found = assistant.call("query_run_data", sql="SELECT max(v) AS most FROM out")
    assert found == {"columns": ["most"], "rows": [[3]]}
    many = assistant.call("query_run_data", sql="SELECT * FROM range(1000000)")
    assert "more than 1000 rows" in many["cut"]
    assert len(many["rows"]) == 1000
    stolen = f"SELECT * FROM read_text('{results.parent}/secret')"  # noqa: S608
    assert "open no other file" in assistant.call("query_run_data", sql=stolen).message


def test_a_query_without_end_is_ended(results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(question, "TIME_LIMIT", 1.0)
    query = "SELECT (COUNT(*) AS ?n) { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i . ?j ?k ?l }"
    with pytest.raises(InputError, match="ended after 1 s"):
        question.answer("sparql", [results / TABLED], query)


def test_provenance_is_queried_and_no_other_machine(assistant: Assistant) -> None:
    campaigns = "SELECT ?c WHERE { ?c a robovast:Campaign }"
    answer = assistant.call("query_provenance", query=campaigns, campaign=TABLED)
    assert len(answer["rows"]) == 1
    name = next(iter(assistant.call("list_provenance_queries")))
    assert assistant.call("query_provenance", query=name)["columns"]
    away = "SELECT * { \\u0053ERVICE <http://127.0.0.1:1/> { ?s ?p ?o } }"
    assert "SERVICE" in assistant.call("query_provenance", query=away).message


def test_no_path_leaves_the_results_folder(results: Path, assistant: Assistant) -> None:
    run = f"{NAME}/hall-1/0"
    for path in (
        "../secret",
        f"{results.parent}/secret",
        f"{NAME}/../../secret",
        f"{run}/secret.txt",
        f"{run}/outside/secret",
        "/etc/passwd",
        "a\0b",
    ):
        for tool in ("get_artifact", "search_run_log", "get_run_data"):
            answer = assistant.call(tool, path=path)
            assert isinstance(answer, Refusal), (tool, path)
            assert SECRET not in answer.message
    for folder in ("..", "/etc", f"{run}/outside", f"{NAME}/../.."):
        assert isinstance(assistant.call("list_artifacts", folder=folder), Refusal), folder
    assert "secret" not in str(assistant.call("list_artifacts", folder=run))
    for campaign in ("..", ".", f"{NAME}/hall-1", f"{run}/outside"):
        assert isinstance(assistant.call("get_campaign", campaign=campaign), Refusal), campaign
    odd = {"campaign": NAME, "configuration": "../hall-1", "run": 0}
    assert isinstance(assistant.call("get_run", **odd), Refusal)


def test_tables_and_graphs_that_are_links_out_are_not_opened(
    results: Path, assistant: Assistant
) -> None:
    trap = results / "trap-2026-01-02-000000"
    (trap / "_execution").mkdir(parents=True)
    for file in ("_execution/tables.duckdb", "metadata.prov.json"):
        (trap / file).symlink_to(results.parent / "secret")
    for tool, asked in (
        ("query_run_data", {"sql": "SELECT 1"}),
        ("query_provenance", {"query": "ASK { ?s ?p ?o }"}),
    ):
        refusal = assistant.call(tool, campaign=trap.name, **asked)
        assert "leads out" in refusal.message
    shutil.rmtree(trap)


def test_long_text_comes_in_parts_that_add_up(results: Path, assistant: Assistant) -> None:
    path = f"{NAME}/hall-1/0/long.txt"
    parts = [assistant.call("get_artifact", path=path)]
    while "cut" in parts[-1]:
        offset = int(parts[-1]["cut"].rpartition("=")[2])
        parts.append(assistant.call("get_artifact", path=path, offset=offset))
    assert len(parts) > 1
    assert "".join(part["text"] for part in parts) == (results / path).read_text()
    film = assistant.call("get_artifact", path=f"{NAME}/hall-1/0/film.webm")
    assert "is not text" in film.message


def test_plugins_add_tools_and_a_broken_one_is_reported(assistant: Assistant, log: Path) -> None:
    assert {"my_tool", "list_campaigns"} <= assistant.tools()
    assert "half" not in assistant.tools()
    assert assistant.result("my_tool").content[0].text == "hello"
    assert "my_plugin" in str(assistant.call("list_plugins"))
    chatter = assistant.result("chatter").content[0].text
    assert len(chatter) < 300_000
    assert chatter.endswith("the rest is cut)")
    said = log.read_text()
    assert "`broken` is skipped: ValueError: no licence" in said
    assert "`missing` is skipped" in said
    assert "Traceback" not in said


def test_ctrl_c_ends_a_server_that_waits_for_a_line(results: Path) -> None:
    command = [VAST, "mcp", "-r", results, "--debug"]
    with subprocess.Popen(command, stdin=PIPE, stdout=PIPE, stderr=PIPE) as server:
        assert server.stdin is not None
        assert server.stdout is not None
        server.stdin.write(json.dumps(INITIALIZE).encode() + b"\n")
        server.stdin.flush()
        assert b"RoboVAST" in server.stdout.readline()
        server.send_signal(signal.SIGINT)
        assert server.wait(PATIENCE) == -signal.SIGINT
        assert b"initialize" in server.stderr.read()  # --debug


def test_http_needs_the_token_and_this_machine(results: Path) -> None:
    with over_http(results) as line:
        url, token = line.split()[-5], line.split()[-1]
        with session(url, auth=token) as assistant:
            assert assistant.call("list_campaigns")["total"] == 2
        place = urlsplit(url)
        assert place.hostname == "127.0.0.1"
        known = {"Authorization": f"Bearer {token}"}
        assert _post(place, {}) == 401
        assert _post(place, {"Authorization": f"Bearer {token[:-1]}"}) == 401
        assert _post(place, known) == 200
        assert _post(place, {**known, "Host": "evil.example"}) == 421
        assert _post(place, {**known, "Origin": "http://evil.example"}) == 403


def _post(place: Any, headers: dict[str, str]) -> int:
    accepted = {"Accept": "application/json, text/event-stream", "Content-Type": "application/json"}
    connection = HTTPConnection(place.hostname, place.port, timeout=PATIENCE)
    connection.request("POST", place.path, json.dumps(INITIALIZE), {**accepted, **headers})
    status = connection.getresponse().status
    connection.close()
    return status

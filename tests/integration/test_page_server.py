"""The page's server answers its user alone, and shows the results folder and nothing else."""

from __future__ import annotations

import gzip
import json
import socket
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from urllib.parse import quote, urlsplit
from urllib.request import urlopen

import pytest
from support.campaigns.drives import record_drive
from support.campaigns.stored import NAME, START, add_map, write, write_campaign, write_run
from support.patience import PATIENCE
from support.servers.page import VAST, ShownPage, shown

EVIL = "<img src=x onerror=alert(1)>"
PICTURE = f"api/map/{NAME}/hall-1"


def judge(parameters, number) -> str:
    return "failed" if parameters["speed"] > 1 else "passed"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shown") / "results"
    root = write_campaign(folder, judge=judge)
    write(folder.parent / "secret", "outside")
    run = root / "hall-1" / "0"
    (run / "secret").symlink_to(folder.parent / "secret")
    (run / "outside").symlink_to(folder.parent)
    write(run / "page.html", "<script>alert(1)</script>")
    write(run / "picture.svg", "<svg xmlns='http://www.w3.org/2000/svg' onload='alert(1)'/>")
    (run / "film.webm").write_bytes(bytes(range(256)))
    add_map(root, "hall-1")
    record_drive(root / "hall-1" / "1" / "rosbag2", 4.0)
    write_run(root, EVIL, 0, 4, {EVIL: 1, "speed": EVIL}, lambda *_: "passed")
    return folder


@pytest.fixture(scope="module")
def page(results: Path) -> Iterator[ShownPage]:
    with shown(results) as page:
        yield page


def test_the_page_shows_campaigns_runs_and_logs(page: ShownPage) -> None:
    assert b"<title>RoboVAST</title>" in page.get("").body
    assert page.get("page.js").headers["content-type"].startswith("text/javascript")
    campaign = page.get(f"api/campaigns/{NAME}").data
    assert campaign["summary"]["counts"]["failed"] == 2
    answer = page.get(f"api/campaigns/{NAME}/hall-2/0").data
    assert [one[:2] for one in answer["siblings"]] == [[0, "failed"], [1, "failed"]]
    assert answer["siblings"][0][2] == pytest.approx(START + 40)
    run = answer["details"]
    log = page.get(f"api/log?path={quote(run['logs'][0])}&levels=error").data
    assert "goal not reached" in log["lines"][0][2]
    assert page.get(f"api/compare?a={NAME}&b={NAME}").data["overall"]["p"] == 1
    beside = page.get(f"api/comparisons?a={NAME}&b={NAME}&b={NAME}").data
    assert [(one["name"], one["comparison"]["overall"]["p"]) for one in beside] == [(NAME, 1)] * 2
    assert page.get("api/reading").data == {}
    usage = page.get(f"api/usage?path={quote(run['usage'][0])}").data
    assert len(usage["time"]) == len(usage["cpu"]) > 4
    table = page.get(f"api/table?path={NAME}/hall-2/0/poses.csv&column=timestamp").data
    assert (table["rows"], list(table["columns"])) == (200, ["timestamp"])


def test_a_configuration_is_drawn_on_its_map(page: ShownPage) -> None:
    answer = page.get(PICTURE)
    assert answer.headers["content-type"].startswith("image/svg+xml")
    assert answer.body.startswith(b"<svg")
    assert page.get(f"api/map/{NAME}/hall-2").status == 404


def test_the_script_is_small_and_sent_compressed(page: ShownPage) -> None:
    answer = page.get("page.js", **{"Accept-Encoding": "gzip"})
    assert answer.headers["content-encoding"] == "gzip"
    assert len(answer.body) < 85_000
    assert gzip.decompress(answer.body) == page.get("page.js").body


def test_lists_are_compressed(page: ShownPage) -> None:
    answer = page.get(f"api/campaigns/{NAME}", **{"Accept-Encoding": "gzip"})
    assert answer.headers["content-encoding"] == "gzip"
    assert json.loads(gzip.decompress(answer.body))["summary"]["name"] == NAME


@pytest.mark.parametrize("path", ["/", "/wrong/", "/wrong/api/campaigns", "//", "/api/campaigns"])
def test_without_the_token_there_is_nothing(page: ShownPage, path: str) -> None:
    answer = page.ask(path)
    assert answer.status == 403
    assert NAME.encode() not in answer.body


@pytest.mark.parametrize(
    "host",
    [
        *("evil.example", "evil.example:80", "127.0.0.1.evil.example", "", None, "[", "10.0.0.1"),
        *("evil@127.0.0.1", "localhost/evil", "localhost#evil", "localhost?evil", "localhost:80@x"),
        *("a:b@localhost", "127.0.0.1:x", "localhost:", "localhost\\evil", "[::1]evil", "127.1"),
    ],
)
def test_another_host_name_is_refused(page: ShownPage, host: str | None) -> None:
    """A site that lets its name point to this machine gets nothing."""
    assert page.get("api/campaigns", Host=host).status in {400, 421}


@pytest.mark.parametrize("host", ["localhost:9999", "127.0.0.1:1", "[::1]:8080", "localhost"])
def test_a_forwarded_port_is_welcome(page: ShownPage, host: str) -> None:
    assert page.get("api/campaigns", Host=host).status == 200


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "null", "http://127.0.0.1:1", "x", "", "http://[", "http://[::1", "//"],
)
def test_another_origin_is_refused(page: ShownPage, origin: str) -> None:
    assert page.get("api/campaigns", Origin=origin).status == 403


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_a_request_that_another_site_makes_is_refused(page: ShownPage, site: str) -> None:
    """Another port of this machine is the same site to a browser."""
    headers = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "no-cors"}
    assert page.get("api/campaigns", **headers).status == 403
    assert page.get("page.js", **headers).status == 403


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS"])
def test_nothing_can_be_changed(page: ShownPage, method: str) -> None:
    assert page.ask(page.base + "api/campaigns", method=method).status == 405


@pytest.mark.parametrize(
    "path",
    [
        "../secret",
        "%2e%2e/secret",
        "..%2fsecret",
        f"{NAME}/../../secret",
        f"{NAME}/%2e%2e/%2e%2e/secret",
        f"{NAME}/hall-1/0/secret",
        f"{NAME}/hall-1/0/outside/secret",
        "/etc/passwd",
        "%2fetc%2fpasswd",
        f"{NAME}/hall-1/0/film.webm%00.png",
    ],
)
def test_no_path_leaves_the_results_folder(page: ShownPage, path: str) -> None:
    for address in (f"files/{path}", f"api/log?path={path}", f"api/table?path={path}"):
        answer = page.get(address)
        assert answer.status in {403, 404}, address
        assert b"outside" not in answer.body.replace(b"out of", b"").replace(path.encode(), b"")


@pytest.mark.parametrize("path", ["..", "%2e%2e", "..%2f..", f"{NAME}/..%2f..", f"../{NAME}"])
def test_no_name_of_a_campaign_leaves_it_either(page: ShownPage, path: str) -> None:
    assert page.get(f"api/campaigns/{path}/0").status in {403, 404}
    assert page.get(f"api/campaigns/{path}").status in {403, 404}


def test_every_answer_forbids_what_the_page_does_not_need(page: ShownPage) -> None:
    for path in (
        "",
        "page.js",
        "api/campaigns",
        "nothing",
        f"files/{NAME}/hall-1/0/page.html",
        PICTURE,
    ):
        headers = page.get(path).headers
        policy = headers["content-security-policy"]
        assert policy.startswith("default-src 'none'")
        assert "unsafe" not in policy
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["cross-origin-resource-policy"] == "same-origin"
        assert headers["cache-control"] == "no-store"
        assert headers.get("access-control-allow-origin") is None


@pytest.mark.parametrize("name", ["page.html", "picture.svg", "run.json", "test.xml"])
def test_a_file_that_a_browser_could_execute_is_only_saved(page: ShownPage, name: str) -> None:
    headers = page.get(f"files/{NAME}/hall-1/0/{name}").headers
    assert headers["content-type"] == "application/octet-stream"
    assert headers["content-disposition"].startswith("attachment;")
    assert "sandbox" in headers["content-security-policy"]


def test_a_player_gets_the_part_it_asks_for(page: ShownPage) -> None:
    path = f"files/{NAME}/hall-1/0/film.webm"
    assert page.get(path).body == bytes(range(256))
    for asked, body in (
        ("bytes=10-19", bytes(range(10, 20))),
        ("bytes=250-", bytes(range(250, 256))),
        ("bytes=-3", bytes(range(253, 256))),
        ("bytes=200-999", bytes(range(200, 256))),
    ):
        answer = page.get(path, Range=asked)
        assert (answer.status, answer.body) == (206, body)
    for beyond in ("256-", f"{'9' * 5000}-", "-0", f"9-{'0' * 5000}8"):
        assert page.get(path, Range=f"bytes={beyond}").status == 416
    assert page.get(path, Range=f"bytes=0-{'9' * 5000}").status == 200
    assert page.get(path, Range="bytes=\xb2-").status == 200, "not a range, so all of the file"


@pytest.mark.parametrize("number", ["9" * 19, "9" * 5000, "0" * 5000, "-1", "%D9%A1", "1e3", "nan"])
@pytest.mark.parametrize(
    "path",
    [
        f"api/campaigns/{NAME}/hall-1/{{}}",
        f"api/drive/{NAME}/hall-1/{{}}",
        f"api/drive/{NAME}/hall-1/0/{{}}",
        f"api/drive/{NAME}/hall-1/0/{{}}/pictures",
        f"api/log?path={NAME}/_jobs/job-0/logs/system.log&before={{}}&end={{}}",
        f"api/log?path={NAME}/_jobs/job-0/logs/system.log&since={{}}&until={{}}",
        f"api/notebooks?campaign={NAME}&batch={{}}",
        f"api/search/{NAME}/sets?first={{}}&count={{}}",
    ],
)
def test_no_number_is_a_fault_of_the_server(page: ShownPage, path: str, number: str) -> None:
    assert page.get(path.format(number, number)).status < 500


def test_an_upgrade_is_answered_as_any_request(page: ShownPage) -> None:
    upgrade = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
    key = {"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="}
    assert page.get("api/campaigns", **upgrade, **key).status == 200
    assert page.get("api/campaigns", **upgrade, **key, Origin="http://evil.example").status == 403


@pytest.mark.parametrize("sent", [b"", b"GET / HTTP/1.1\r\n", b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"])
def test_waiting_connections_lock_nobody_out(page: ShownPage, sent: bytes) -> None:
    place = urlsplit(page.address)
    held = [socket.create_connection((place.hostname, place.port)) for _ in range(400)]
    try:
        for one in held:
            with suppress(OSError):
                one.sendall(sent)
        assert page.get("api/campaigns").status == 200
        held[-1].settimeout(PATIENCE)
        with suppress(ConnectionResetError):
            while held[-1].recv(1 << 16):
                pass  # closed by the server in the end
    finally:
        for one in held:
            one.close()


def test_names_with_markup_are_data(page: ShownPage) -> None:
    answer = page.get(f"api/campaigns/{NAME}")
    assert answer.headers["content-type"] == "application/json"
    assert EVIL in answer.data["variants"]["name"]
    assert (
        page.get(f"api/campaigns/{NAME}/{quote(EVIL)}/0").data["details"]["record"]["variant"]
        == EVIL
    )


def test_a_fault_of_the_request_is_an_error_with_words(page: ShownPage) -> None:
    for path in ("api/log", "api/nothing", "api/campaigns/none", "api/log?path=a&since=x"):
        answer = page.get(path)
        assert answer.status == 404
        assert answer.data["error"]


def test_a_run_is_announced_as_soon_as_it_is_stored(tmp_path: Path) -> None:
    root = write_campaign(tmp_path, outputs=False)
    with shown(tmp_path) as page, socket.create_connection(_place(page), PATIENCE) as connection:
        request = f"GET {page.base}api/events HTTP/1.1\r\nHost: localhost\r\n\r\n"
        connection.sendall(request.encode())
        stream = connection.makefile("r")
        assert _next_event(stream) == {NAME: 1}
        write_run(root, "hall-1", 2, 4, {"speed": 1.0}, lambda *_: "passed", outputs=False)
        assert _next_event(stream) == {NAME: 2}


def test_it_listens_on_this_machine_only(page: ShownPage) -> None:
    _, port = _place(page)
    with socket.socket() as other, pytest.raises(OSError, match="refused"):
        other.connect(("127.0.0.2", port))


def test_a_folder_that_is_not_there_is_an_error_in_words(tmp_path: Path) -> None:
    command = [VAST, "eval", "gui", "-r", tmp_path / "none", "--no-browser"]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 2
    assert "none: cannot be read: No such file or directory" in result.stderr


@pytest.mark.parametrize(
    ("folder", "said"),
    [
        ("none", "does not exist"),
        (NAME, "is the folder of a campaign\nhint: name the folder of a run"),
        (f"{NAME}/hall-1", "is not a run folder\nhint: name the folder of a run"),
        (f"{NAME}/hall-2/0", "has no recording: no folder contains .mcap or .db3 files"),
    ],
)
def test_what_cannot_be_played_is_an_error_in_words(results: Path, folder: str, said: str) -> None:
    command = [VAST, "view", results / folder, "--no-browser"]
    result = subprocess.run(command, capture_output=True, text=True)
    assert (result.returncode, said in result.stderr) == (2, True), result.stderr


def test_a_run_is_played_from_its_folder(page: ShownPage, results: Path) -> None:
    run = results / NAME / "hall-1" / "1"
    command = [VAST, "view", run, "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
        finally:
            process.terminate()
    assert line.endswith(f"#/campaign/{NAME}/hall-1/1?tab=player\n")
    answer = page.get(f"api/drive/{NAME}/hall-1/1").data
    assert answer["overview"]["topics"]["pose"] == "/odom"
    assert (answer["ground"]["columns"], answer["verdict"]) == (40, "passed")
    assert len(page.get(f"api/drive/{NAME}/hall-1/1/0?scans=1").data["scans"]) == 40
    assert page.get(f"api/drive/{NAME}/hall-1/1/7").status == 404
    bare = page.get(f"api/drive/{NAME}/hall-2/0").data
    assert bare["overview"] is None
    assert any(
        "no folder with .mcap or .db3 files. Record a bag" in text for text in bare["remarks"]
    )
    assert any("Without a map" in remark for remark in bare["remarks"])


def test_a_campaign_folder_is_shown_among_its_neighbours(results: Path) -> None:
    with shown(results / NAME) as page:
        assert list(page.get("api/campaigns").data["campaigns"]) == [NAME]


HELD = """
import pathlib, time

def held(results_dir, config_dir):
    while not pathlib.Path({go!r}).exists():
        time.sleep(0.05)
    return True, ""
"""


def _prepared(page: ShownPage, go: Path) -> list[dict[str, int | bool]]:
    """What the page is told of tables until all of them are there; lets them be made."""
    told: list[dict[str, int | bool]] = []
    with urlopen(f"{page.address}api/events", timeout=PATIENCE) as stream:  # noqa: S310
        for line in stream:
            if line == b"event: preparing\n":
                told.append(json.loads(next(stream).removeprefix(b"data: ")))
                go.touch()
                if not told[-1]["running"]:
                    break
    return told


def test_the_page_is_there_while_tables_are_made_and_says_so(tmp_path: Path) -> None:
    results, go = tmp_path / "results", tmp_path / "go"
    root = write_campaign(results, variants=[{"speed": 1.0}], runs=1)
    write(root / "_transient" / "configurations.yaml", "configs: []\n")
    section = "results_processing:\n  postprocessing: ['held.py:held']\n"
    write(root / "_config" / "hall.vast", f"version: 1\n{section}")
    write(root / "_config" / "held.py", HELD.format(go=str(go)))
    with shown(results, postprocess=True) as page:
        first, *_, last = _prepared(page, go)
        assert first == {"done": 0, "total": 1, "running": True, "changed": False}
        assert last == {"done": 1, "total": 1, "running": False, "changed": True}
        metrics = page.get(f"api/campaigns/{NAME}/metrics").data
        assert metrics["columns"]["poses"] == ["timestamp", "position.x", "position.y"]
        query = "metric?table=poses&column=position.x&aggregate=most"
        assert page.get(f"api/campaigns/{NAME}/{query}").data == {"hall-1/0": 9.95}


def _place(page: ShownPage) -> tuple[str, int]:
    host, _, port = page.address.split("/")[2].partition(":")
    return host, int(port)


def _next_event(stream) -> dict[str, int]:
    while not (line := stream.readline()).startswith("data: "):
        assert line
    return json.loads(line.removeprefix("data: "))


PARTS = ["%00", "a%00b", "x" * 300, "%C3%A4" * 150, "%2e%2e", ".", "..", "%0a", "%ff", "%2500"]
"""Names that no file has, or that are hard to handle."""


@pytest.mark.parametrize("part", PARTS)
def test_names_that_no_file_has_are_not_found(page: ShownPage, part: str) -> None:
    paths = [
        *(f"history/{NAME}/{part}", f"history/{part}/hall-1", f"drive/{part}/hall-1/0"),
        *(
            f"drive/{NAME}/{part}/0",
            f"drive/{NAME}/{part}/0/1",
            f"drive/{NAME}/{part}/0/1/pictures",
        ),
        *(f"map/{NAME}/{part}", f"map/{part}/hall-1", f"maps/{part}", f"failures/{part}"),
        *(f"campaigns/{part}", f"campaigns/{NAME}/{part}/0", f"campaigns/{part}/hall-1/0"),
        *(f"campaigns/{part}/{page}" for page in ("begun", "about", "factors", "metrics", "more")),
        *(f"compare?a={part}&b={NAME}", f"changes?a={NAME}&b={part}", f"table?path={part}"),
        *(f"log?path={NAME}/{part}", f"usage?path={part}", f"timeline?path={part}"),
    ]
    answers = {path: page.get(f"api/{path}").status for path in paths}
    assert not {path: status for path, status in answers.items() if status >= 500}
    if part in PARTS[:5]:
        assert {status for path, status in answers.items() if "?" not in path} == {404}

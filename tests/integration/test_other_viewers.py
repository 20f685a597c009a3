"""`vast view --rerun` and `--foxglove`: the recording, on this machine alone, and nothing else."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import StoragePlugin
from support.campaigns.drives import record_drive
from support.campaigns.stored import NAME, write, write_campaign
from support.patience import PATIENCE
from support.servers.page import VAST, ShownPage

INSTALLED = find_spec("rerun_cli") is not None
STAND_IN = """#!{python}
import http.server, json, os, pathlib, shutil, sys
words = sys.argv[1:]
settings = pathlib.Path(os.environ["XDG_CONFIG_HOME"], "rerun", "analytics.json")
with open({log!r}, "a") as log:
    print(json.dumps([words, json.loads(settings.read_text())]), file=log)
if words[:2] == ["mcap", "convert"]:
    shutil.copy(words[2], words[words.index("-o") + 1])
else:
    class Page(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200 if self.path == "/" else 404)
            self.end_headers()
            self.wfile.write(b"<title>Rerun</title>" if self.path == "/" else b"")
    place = words[words.index("--bind") + 1], int(words[words.index("--web-viewer-port") + 1])
    http.server.HTTPServer(place, Page).serve_forever()
"""
"""Takes the arguments of Rerun that we give; the real one is also tested where it is installed."""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs whose bags are whole, SQLite, cut off, damaged, and missing."""
    folder = tmp_path_factory.mktemp("viewed") / "results"
    root = write_campaign(folder, runs=2)
    record_drive(root / "hall-1" / "0" / "rosbag2", 4.0)
    record_drive(root / "hall-1" / "1" / "rosbag2", 4.0, storage=StoragePlugin.SQLITE3)
    record_drive(root / "hall-2" / "0" / "rosbag2", 4.0)
    (cut,) = (root / "hall-2" / "0" / "rosbag2").glob("*.mcap")
    os.truncate(cut, cut.stat().st_size // 2)
    write(root / "hall-2" / "1" / "rosbag2" / "rosbag2.mcap", "no bag")
    return folder


@contextmanager
def viewed(run: Path, *options: str, path: str = "") -> Iterator[tuple[ShownPage, list[str]]]:
    """A run in a viewer, and what is said of it."""
    process = subprocess.Popen(
        [VAST, "view", run, "--no-browser", *options],
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        said = []
        while not any("http://" in line for line in said):
            said.append(process.stdout.readline())
            assert said[-1], process.communicate()
        yield ShownPage(said[-1].split()[-1], process), said
    finally:
        process.terminate()
        process.communicate(timeout=PATIENCE)


def count(data: bytes) -> int:
    """Messages of an MCAP file, by its index."""
    summary = make_reader(BytesIO(data)).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    return summary.statistics.message_count


def test_a_page_of_another_site_reads_parts_of_a_recording(results: Path) -> None:
    """As Foxglove and Lichtblick do: they want ranges, the size, and leave to see both."""
    run = results / NAME / "hall-1" / "0"
    with viewed(run, "--foxglove") as (page, _):
        path, origin = urlsplit(page.address).path, {"Origin": "http://localhost:8080"}
        assert path.endswith("/hall-1-0.mcap")
        whole = page.ask(path, origin)
        (recorded,) = (run / "rosbag2").glob("*.mcap")
        assert whole.body == recorded.read_bytes()
        assert whole.headers["accept-ranges"] == "bytes"
        assert whole.headers["access-control-allow-origin"] == "*"
        shown = whole.headers["access-control-expose-headers"]
        assert {"accept-ranges", "content-length"} <= set(shown.split(", "))
        part = page.ask(path, origin | {"Range": "bytes=8-15"})
        assert (part.status, part.body) == (206, whole.body[8:16])
        asked = {
            "Access-Control-Request-Method": "GET",
            "Access-Control-Request-Headers": "range",
            "Access-Control-Request-Private-Network": "true",
        }
        allowed = page.ask(path, origin | asked, "OPTIONS")
        assert allowed.status == 200
        assert allowed.headers["access-control-allow-private-network"] == "true"
        assert page.ask("/guessed/hall-1-0.mcap").status == 403
        assert page.ask(path, {"Host": "evil.example"}).status == 400
        port = urlsplit(page.address).port
        with socket.socket() as other, pytest.raises(OSError, match="refused"):
            other.connect(("127.0.0.2", port))


def test_any_bag_is_served_as_a_whole_mcap_file(results: Path) -> None:
    messages = []
    for run in ("hall-1/0", "hall-1/1", "hall-2/0"):
        with viewed(results / NAME / run, "--foxglove") as (page, said):
            messages.append(count(page.ask(urlsplit(page.address).path).body))
            assert ("Incomplete: rosbag2.mcap has no end" in said[0]) == (run == "hall-2/0")
    whole, of_sqlite, cut = messages
    assert whole == of_sqlite > cut > 0


@pytest.fixture(params=["stand-in", *(["real"] if INSTALLED else [])])
def rerun(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[str, Path]:
    """Rerun as an installed package; where the stand-in notes how it was started."""
    log = tmp_path / "log.jsonl"
    if request.param == "real":
        return os.environ.get("PYTHONPATH", ""), log
    program = tmp_path / "installed" / "rerun_cli" / "rerun"
    write(program, STAND_IN.format(python=sys.executable, log=str(log)))
    program.chmod(0o755)
    write(program.with_name("__init__.py"), "")
    return str(tmp_path / "installed"), log


def test_rerun_shows_the_recording_and_tells_nobody(results: Path, rerun: tuple[str, Path]) -> None:
    path, log = rerun
    with viewed(results / NAME / "hall-1" / "0", "--rerun", path=path) as (page, _):
        place = urlsplit(page.address)
        recording = unquote(place.query.removeprefix("url="))
        assert recording.startswith(page.address.partition("?")[0])
        assert len(page.ask(urlsplit(recording).path).body) > 1000
        html = page.ask(place.path)
        assert b"<title>Rerun" in html.body
        allowed = html.headers["content-security-policy"]
        assert "default-src 'self' data: blob:" in allowed
        assert "http" not in allowed
        assert page.ask("/guessed/").status == 403
        assert page.ask(place.path, {"Origin": "http://evil.example"}).status == 403
    if log.exists():
        (_, first), (words, second) = map(json.loads, log.read_text().splitlines())
        assert first["analytics_enabled"] is second["analytics_enabled"] is False
        assert words[:3] == ["--serve-web", "--bind", "127.0.0.1"]


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM])
def test_a_closed_terminal_leaves_no_files_and_no_viewer(
    results: Path,
    rerun: tuple[str, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    number: int,
) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setenv("TMPDIR", str(scratch))
    before = signal.signal(number, signal.SIG_DFL)  # `nohup` would be inherited
    try:
        with viewed(results / NAME / "hall-1" / "0", "--rerun", path=rerun[0]) as (page, _):
            assert list(scratch.iterdir())
            page.process.send_signal(number)
            page.process.wait(PATIENCE)
    finally:
        signal.signal(number, before)
    assert not list(scratch.iterdir())


@pytest.mark.parametrize(
    ("run", "options", "code", "said"),
    [
        ("hall-1/0", ["--rerun", "--foxglove"], 2, "exclude each other"),
        ("hall-2/1", ["--foxglove"], 2, "rosbag2.mcap is not an MCAP file"),
        ("hall-1", ["--foxglove"], 2, "is not a run folder"),
        *([] if INSTALLED else [("hall-1/0", ["--rerun"], 3, "[rerun]")]),
    ],
)
def test_what_cannot_be_viewed_is_an_error_in_words(
    results: Path, run: str, options: list[str], code: int, said: str
) -> None:
    command = [VAST, "view", results / NAME / run, "--no-browser", *options]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, said in done.stderr) == (code, True), done.stderr


@pytest.mark.parametrize("viewer", ["--rerun", "--foxglove"])
def test_a_port_that_is_taken_is_an_error_in_words(results: Path, viewer: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        command = [VAST, "view", results / NAME / "hall-1" / "0", viewer, "--port", port]
        done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert f"Port {port} cannot be used: Address already in use" in done.stderr

"""Each reader of untrusted data: valid files for it, and what reads them."""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
import shutil
import tarfile
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from support.core_only import ROOT

CASES = ROOT / "tests/data/cases"
EXAMPLES = ROOT / "configs/examples"
STAMP = "2026-03-05-121530"


class FaultError(Exception):
    """A reader showed an internal error in place of one of RoboVAST's own."""


@dataclass(frozen=True)
class Reader:
    """Reads one kind of files."""

    make: Callable[[Path, Random], None]
    """Writes valid files into an empty folder."""
    read: Callable[[Path, Random], object]
    """Reads the files of a folder, of which some were mutated."""
    files: str = "*"
    """Which of them are mutated: pattern of their paths in the folder."""


def cases(kind: str, pattern: str) -> list[Path]:
    """The files of the cases of a kind."""
    return sorted(path for path in (CASES / kind).rglob(pattern) if path.is_file())


def _examples(folder: Path, chance: Random) -> None:
    example = chance.choice(sorted(EXAMPLES.glob("*/*.vast")))
    shutil.copytree(example.parent, folder, dirs_exist_ok=True)
    for other in folder.glob("*.vast"):
        if other.name != example.name:
            other.unlink()


def _read_document(folder: Path, _: Random) -> None:
    from robovast.compat.differences import differences
    from robovast.model.document import load_document

    for path in folder.glob("*.vast"):
        list(differences(load_document(path)))


def _plans(folder: Path, chance: Random) -> None:
    plans = chance.choice(sorted(EXAMPLES.glob("*/plans")))
    shutil.copytree(plans, folder, dirs_exist_ok=True)


def _read_plans(folder: Path, _: Random) -> None:
    from robovast.base.errors import RobovastError
    from robovast.navigation.floorplan.language import read_floorplan
    from robovast.navigation.floorplan.sampling import read_variation

    for path in sorted(folder.iterdir()):
        with contextlib.suppress(RobovastError):
            read_floorplan(path) if path.suffix == ".fpm" else read_variation(path)


def _map(folder: Path, chance: Random) -> None:
    found = cases("maps", "*.yaml")
    if found and chance.random() < 0.7:
        shutil.copytree(chance.choice(found).parent, folder, dirs_exist_ok=True)
        return
    import numpy as np

    from robovast.navigation.occupancy import OccupancyMap, write_map

    free = np.ones((30, 40), bool)
    write_map(OccupancyMap(free, ~free, 0.1, (0.0, 0.0)), folder / "hall.yaml")


def _read_map(folder: Path, _: Random) -> None:
    from robovast.base.errors import RobovastError
    from robovast.navigation.occupancy import read_map

    for path in folder.glob("*.yaml"):
        with contextlib.suppress(RobovastError):
            read_map(path)


def _verdict(folder: Path, chance: Random) -> None:
    found = cases("junit", "test.xml")
    if found and chance.random() < 0.8:
        shutil.copy(chance.choice(found), folder / "test.xml")
    else:
        from support.campaigns.finished import TEST_XML

        (folder / "test.xml").write_text(TEST_XML)


def _read_verdict(folder: Path, _: Random) -> None:
    from robovast.campaign.verdict import read_test_result

    read_test_result(folder)


def _campaign(folder: Path, chance: Random) -> None:
    """A campaign of any kind; of another tool, described, searched or finished."""
    from support.campaigns import described, finished, searches, stored

    kind = chance.randrange(5)
    if kind == 0:
        described.make_old_campaign(folder / f"old-{STAMP}")
    elif kind == 1:
        searches.write_search(folder, batches=1, **searches.SEVERAL)
    elif kind == 2:
        stored.add_map(stored.write_campaign(folder), "hall-1")
    else:
        campaign = finished.finished_campaign(folder, 2, "    - rosbags_to_csv\n")
        tables = cases("tables", "*.csv")
        run = campaign / "c-1" / "0"
        if tables:
            shutil.copy(chance.choice(tables), run / "case.csv")
        xmls = cases("junit", "test.xml")
        if xmls and kind == 4:
            shutil.copy(chance.choice(xmls), run / "test.xml")
            (run / "run.json").unlink()


_COMMANDS = (
    ("results", "summary", "{name}"),
    ("results", "metadata", "-r", "{results}"),
    ("results", "report", "{name}", "-o", "{results}/report.html"),
    ("results", "junit", "{name}", "{results}/junit.xml"),
    ("results", "coverage", "{name}"),
    ("results", "history", "c-1"),
    ("results", "compare", "{name}", "{name}"),
    ("results", "query", "SELECT * FROM runs"),
    ("results", "search", "{name}"),
    ("results", "merge-campaigns", "{results}/merged"),
    ("evaluation", "index", "-r", "{results}"),
)


def _read_campaign(folder: Path, chance: Random) -> None:
    (name,) = (path.name for path in folder.iterdir())
    for words in chance.sample(_COMMANDS, 3):
        given = [word.format(name=name, results=folder) for word in words]
        if words[0] == "results" and "-r" not in words:
            given += ["-r", str(folder)]
        run_command(*given)


def _postprocess(folder: Path, _: Random) -> None:
    run_command("results", "postprocess", "-r", str(folder))


def run_command(*words: str) -> tuple[int, str]:
    """Run `vast` in this process; returns its exit code and what it printed on stderr.

    Raises:
        FaultError: the command reported a bug.
    """
    from robovast_cli.main import command

    said = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
        try:
            command()(["-l", "debug", *words], prog_name="vast")
        except SystemExit as end:
            code = end.code
    if code not in (0, 1, 2, 3, 4, 5, 6):
        raise FaultError(f"vast {' '.join(words)}: exit code {code}: {said.getvalue()[-3000:]}")
    return int(code), said.getvalue()


_PAGES = (
    *("campaigns", "campaigns/{c}", "campaigns/{c}/about", "campaigns/{c}/factors"),
    *("campaigns/{c}/metrics", "campaigns/{c}/logs", "campaigns/{c}/more", "campaigns/{c}/metric"),
    *("campaigns/{c}/{v}/0", "history/{c}/{v}", "map/{c}/{v}", "maps/{c}?variant={v}"),
    *("failures/{c}", "drive/{c}/{v}/0", "compare?base={c}&new={c}", "changes?base={c}&new={c}"),
    *("events?path={c}", "log?path={c}/{v}/0/logs/system.log", "table?path={c}/{v}/0/out.csv"),
    *("notebooks?path={c}", "timeline?path={c}/{v}/0/bag", "usage?path={c}/{v}/0", "search/{c}"),
)


def _read_pages(folder: Path, chance: Random) -> None:
    from robovast.evaluation.library import Library
    from robovast.evaluation.notebooks.runner import Runner
    from robovast.evaluation.server.app import make_app
    from robovast.evaluation.server.launches import LaunchPages, Starting
    from robovast.evaluation.server.notebooks import NotebookPages

    (campaign,) = folder.iterdir()
    variant = chance.choice([path.name for path in campaign.iterdir() if path.name[0] != "_"])
    library, runner = Library(folder), Runner(5.0)
    starting = Starting([], None, "", False, lambda _: None)
    pages = chance.sample(_PAGES, 8)

    async def answers() -> list[tuple[str, int, bytes]]:
        launches = LaunchPages(library.results, starting, None)
        app = make_app(
            library, NotebookPages(library, runner, None), launches, "t", asyncio.Event()
        )
        return [
            (path, *await _answer(app, "/t/api/" + path.format(c=campaign.name, v=variant)))
            for path in pages
        ]

    try:
        for path, status, body in asyncio.run(answers()):
            if status >= 500:
                raise FaultError(f"{path}: {status}: {body[:1000]!r}")
    finally:
        runner.close()


async def _answer(app: Any, path: str) -> tuple[int, bytes]:
    path, _, query = path.partition("?")
    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": "GET",
        "scheme": "http",
        "path": path,
        "raw_path": path.encode(),
        "query_string": query.encode(),
        "root_path": "",
        "headers": [(b"host", b"localhost")],
        "client": ("127.0.0.1", 1),
        "server": ("127.0.0.1", 2),
    }
    status, body = 0, b""
    parts = iter([{"type": "http.request", "body": b"", "more_body": False}])

    async def receive() -> dict[str, Any]:
        return next(parts, {"type": "http.disconnect"})

    async def send(message: dict[str, Any]) -> None:
        nonlocal status, body
        status = message.get("status", status)
        body += message.get("body", b"")

    try:
        await app(scope, receive, send)
    except Exception as error:  # Starlette answers, and raises once more for its server
        if status < 500:
            raise
        body += f" {type(error).__name__}: {error}".encode()
    return status, body


def _bag(folder: Path, chance: Random) -> None:
    bags = sorted(path for path in (CASES / "bags").iterdir() if path.is_dir())
    shutil.copytree(chance.choice(bags), folder / f"bag-{STAMP}")


def _drive(folder: Path, chance: Random) -> None:
    from rosbags.rosbag2 import CompressionMode, StoragePlugin

    from support.campaigns.drives import record_drive

    run = folder / f"bag-{STAMP}" / "c" / "0"
    run.mkdir(parents=True)
    (run / "test.xml").write_text("<testsuite tests='1'><testcase name='a'/></testsuite>")
    storage = chance.choice(list(StoragePlugin))
    compression = chance.choice([None, CompressionMode.FILE, CompressionMode.MESSAGE])
    record_drive(run / "rosbag2", 1.0, pictures=True, storage=storage, compression=compression)


_BAG_COMMANDS = [
    {"type": "to_csv"},
    {"type": "tf_to_csv", "frames": ["base_link"]},
    {"type": "bt_to_csv"},
    {"type": "rosout_to_csv"},
]


def _read_bag(folder: Path, _: Random) -> None:
    from robovast.analysis.bags.commands import rosbags_process

    (campaign,) = folder.iterdir()
    _, message = rosbags_process(str(campaign), str(campaign), _BAG_COMMANDS)[:2]
    if "raised" in message or "Error:" in message:
        raise FaultError(message)


def _read_drive(folder: Path, _: Random) -> None:
    from robovast.evaluation.drive.drives import Drives

    for bag in (path.parent for path in folder.rglob("metadata.yaml")):
        drive = Drives(folder).drive(str(bag.relative_to(folder)), {})
        drive.overview()


def _archive(folder: Path, chance: Random) -> None:
    name = f"camp-{STAMP}"
    files = {
        "_config/x.vast": b"version: 1\n",
        "one/_config/config.yaml": b"a: 1\n",
        "one/0/test.xml": b"<testsuite tests='1'><testcase name='a'/></testsuite>",
        "one/0/long" + "g" * 120: b"x" * 5000,
    }
    if chance.random() < 0.3:
        with zipfile.ZipFile(folder / f"{name}.zip", "w", chance.choice((0, 8))) as zipped:
            for path, content in files.items():
                zipped.writestr(f"{name}/{path}", content)
        return
    mode, format_ = chance.choice(("w", "w", "w:gz")), chance.choice((0, 1, 2))
    with tarfile.open(folder / f"{name}.tar.gz", mode, format=format_) as tar:
        for path, content in files.items():
            path = path if format_ else path[:80]  # the oldest format has no longer names
            info = tarfile.TarInfo(f"{name}/{path}")
            info.size = len(content)
            if format_ == 2:
                info.pax_headers = {"comment": "1", "mtime": "1.5"}
            tar.addfile(info, io.BytesIO(content))
        link = tarfile.TarInfo(f"{name}/one/0/job")
        link.type, link.linkname = tarfile.SYMTYPE, "../../_jobs/job-0"
        tar.addfile(link)


def _read_archive(folder: Path, _: Random) -> None:
    from robovast.campaign.importing import import_archive

    (archive,) = folder.iterdir()
    import_archive(archive, folder / "imported")


def _project(folder: Path, _: Random) -> None:
    (folder / ".env").write_text("A=1\nexport B='two words'\nC=\"${A}x\" # comment\n")
    data = {"config": "x.vast", "results_dir": "results", "log_level": "INFO"}
    (folder / ".robovast_project").write_text(json.dumps(data))


def _read_project(folder: Path, _: Random) -> None:
    from robovast.base.environment import environment
    from robovast.base.errors import RobovastError
    from robovast.model.project import find_project

    with contextlib.suppress(RobovastError):
        find_project(folder)
    environment(folder)


def _records(folder: Path, _: Random) -> None:
    from robovast.campaign.run_files import StoredFile, write_list
    from support.campaigns.finished import finished_campaign

    listed = write_list([StoredFile("a/b.csv", 3, "0" * 64, "a/b.csv")])
    (folder / "files").write_bytes(listed)
    (folder / "owner").write_text(json.dumps({"campaign": "camp", "uid": "u-1"}))
    (folder / "message").write_text(json.dumps({"error": "none", "stored": 3}))
    record = next(finished_campaign(folder / "results", 1).rglob("run.json"))
    record.rename(folder / "record")
    shutil.rmtree(folder / "results")


def _read_records(folder: Path, _: Random) -> None:
    from robovast.base.errors import RobovastError
    from robovast.campaign.run_files import read_list
    from robovast.campaign.run_record import parse_known, parse_run_record
    from robovast.kubeapi.pod_contract.messages import error_in
    from robovast.storage.bucket_ownership import parse_owner

    content = {path.name: path.read_bytes() for path in folder.iterdir()}
    parse_run_record(content["record"])
    parse_known(content["record"])
    error_in(content["message"].decode(errors="replace"))
    with contextlib.suppress(RobovastError):
        parse_owner(content["owner"], "bucket")
    with contextlib.suppress(ValueError):  # its callers report the place
        read_list(content["files"])


READERS: dict[str, Reader] = {
    "document": Reader(_examples, _read_document, "*.*"),
    "floorplan": Reader(_plans, _read_plans, "*.*"),
    "map": Reader(_map, _read_map),
    "verdict": Reader(_verdict, _read_verdict),
    "archive": Reader(_archive, _read_archive),
    "project": Reader(_project, _read_project),
    "bag": Reader(_bag, _read_bag, "**/rosbag2*/*"),
    "drive": Reader(_drive, _read_drive, "**/rosbag2*/*"),
    "drive-tables": Reader(_drive, _read_bag, "**/rosbag2*/*"),
    "bag-drive": Reader(_bag, _read_drive, "**/rosbag2*/*"),
    "campaign": Reader(_campaign, _read_campaign, "**/*.*"),
    "records": Reader(_records, _read_records),
    "postprocess": Reader(_campaign, _postprocess, "**/*.*"),
    "page": Reader(_campaign, _read_pages, "**/*.*"),
}


def inputs(folder: Path, reader: Reader) -> Iterator[Path]:
    """The files of a folder that a reader's mutation may change."""
    return (path for path in folder.glob(reader.files) if path.is_file() and not path.is_symlink())

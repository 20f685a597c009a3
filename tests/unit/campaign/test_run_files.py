"""Keys and lists of a run's files."""

from __future__ import annotations

import itertools
import json
import os
import tracemalloc
from pathlib import Path

import pytest

from robovast.analysis.postprocessing.content import digests
from robovast.campaign.run_files import (
    FULL,
    LONGEST_KEY,
    ROOM,
    Missing,
    MissingFile,
    StoredFile,
    Writer,
    escaped,
    is_writers,
    read_list,
    room_of,
    write_list,
)
from robovast.campaign.run_record import record_text

NAMES = [
    *(
        b"a",
        b"\xe4",
        b"\\xe4",
        b"\\\\xe4",
        "ä".encode(),
        b"\n",
        b"\\n",
        b" ",
        b"%0a",
        b"a\\",
        b"\x7f",
    ),
    *("名".encode() * 85, "\u202e".encode(), "\ufffd".encode(), b"\xff\xfe"),
]


def test_every_name_has_a_key_of_its_own_that_is_plain_text() -> None:
    keys = {escaped(os.fsdecode(name)) for name in NAMES}
    assert len(keys) == len(NAMES)
    assert all(key.isprintable() and key.encode() for key in keys)
    assert escaped("maps/hall 2.yaml") == "maps/hall 2.yaml"
    assert escaped(os.fsdecode(b"map_\xe4.pgm")) == r"map_\xe4.pgm"


def test_keys_are_never_longer_than_servers_take() -> None:
    writer = Writer("hall-1/0")
    paths = ["/".join(["名" * 85] * depth) for depth in range(1, 9)]
    paths += [os.fsdecode(b"\xe4" * length) for length in (1, 63, 64, 255)]
    keys = [writer.key(path, number) for number, path in enumerate(paths)]
    assert len(set(keys)) == len(paths)
    for key in keys:
        assert is_writers(key)
        assert len(f"hall-1/0/{key}".encode()) <= LONGEST_KEY
        assert max(len(part.encode()) for part in key.split("/")) <= 255


def test_writers_have_places_of_their_own() -> None:
    first, second = Writer("hall-1/0"), Writer("hall-1/0")
    keys = [w.key(path, n) for w in (first, second) for n, path in enumerate(("a", "x" * 1200))]
    keys += [first.list_key, second.list_key]
    assert len(set(keys)) == 6
    assert all(map(is_writers, keys))
    assert not any(map(is_writers, ["a", ".writer-a/b", "run.json", ".writer-0123456789abcdef0/b"]))


def test_a_list_is_read_as_it_was_written() -> None:
    names = itertools.chain(NAMES, [b"a/b", b".writer-x/c"])
    files = [StoredFile(os.fsdecode(name), f"k/{n}", n, "ab") for n, name in enumerate(names)]
    again = read_list(write_list(files))
    assert sorted(again, key=lambda f: f.size) == files
    assert {os.fsencode(file.path) for file in again} >= set(NAMES)


@pytest.mark.parametrize("path", ["", "/", "/etc/passwd", "../x", "a/../../x", "a//b", ".", "a\0b"])
@pytest.mark.parametrize("which", ["path", "key"])
def test_a_list_that_leads_out_is_refused(path: str, which: str) -> None:
    item = {"path": "a", "key": "a", "size": 1, "sha256": "", which: path}
    with pytest.raises(ValueError, match="leaves its folder"):
        read_list(json.dumps({"files": [item]}).encode())


DEEP = f'{{"files": {"[" * 100_000}'


@pytest.mark.parametrize(
    "text", [DEEP, "", "[]", "{}", '{"files": 1}', '{"files": [{}]}', '{"files": [1]}']
)
def test_what_is_no_list_is_refused(text: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 - of any text
        read_list(text.encode())


@pytest.mark.parametrize(
    "bad",
    [
        {"size": "1"},
        {"size": None},
        {"size": -1},
        {"size": True},
        {"sha256": None},
        {"path": "\ud800"},
        {"key": "\ud800"},
        {"key": "a" * 2000},
        {"path": "b"},
    ],
)
def test_what_no_writer_writes_is_no_list(bad: dict[str, object]) -> None:
    good = {"path": "a", "key": "a", "size": 1, "sha256": ""}
    other = {**good, "path": "b", "key": "b"}
    assert read_list(json.dumps({"files": [good, other]}).encode())
    with pytest.raises(ValueError, match=r"it |occurs twice|leaves"):
        read_list(json.dumps({"files": [{**good, **bad}, other]}).encode())


def test_a_name_that_a_server_takes_for_a_folder_is_escaped() -> None:
    assert escaped("a__XLDIR__") == r"a_\x5fXLDIR__"
    assert escaped("__xldir__") == "__xldir__"


def test_a_record_holds_some_of_many_missing_files() -> None:
    missing = Missing()
    for number in range(2000):
        missing.add(str(number), "gone")
    told = missing.first(50)
    assert len(told) == 51
    assert told[-1] == MissingFile("…", "and 1950 more", 1950)
    assert sum(file.count for file in told) == 2000
    missing.add_beyond()
    assert missing.first(50)[0] == MissingFile("…", f"1 files: {FULL}", 1)
    assert Missing().first() == ()


def test_a_full_list_is_as_large_as_its_room_at_most() -> None:
    names = itertools.cycle([*NAMES, b"\xff" * 200, b"plain", "\U0001f600".encode() * 60])
    paths = [
        os.fsdecode(name) + f"/{number}" for number, name in zip(range(5000), names, strict=False)
    ]
    writer = Writer("v/0")
    files = [StoredFile(p, writer.key(p, n), 10**12, "a" * 64) for n, p in enumerate(paths)]
    assert len(write_list(files)) <= sum(map(room_of, paths))


def test_a_full_list_fits_into_the_agents_memory() -> None:
    number = 10_000
    tracemalloc.start()
    try:
        path = "data/frame-{:06}.png".format
        writer = Writer("v/0")
        stored = [
            StoredFile(path(n), writer.key(path(n), n), n, f"{n:064x}") for n in range(number)
        ]
        content = write_list(stored)
        assert len(content) < ROOM // 10
        _, written = tracemalloc.get_traced_memory()
        del stored
        assert len(read_list(content)) == number
        _, read = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert written < 12 << 20, "a tenth of what a full list takes"
    assert read < 24 << 20


def test_a_place_in_a_bucket_is_no_change_of_a_run(tmp_path: Path) -> None:
    record = {"verdict": "passed", "exit_code": None, "parameters": {"x": 1}, "schema": 1}
    found = set()
    for number, place in enumerate((None, {"key": "a", "count": 1}, {"key": "b", "count": 2})):
        path = tmp_path / str(number) / "run.json"
        path.parent.mkdir()
        data = record if place is None else {**record, "files": place, "schema": 1}
        path.write_text(record_text(data))
        found.add(digests(path.parent, [path.name])[path.name])
    assert len(found) == 1
    path.write_text(record_text({**record, "verdict": "failed", "files": {}}))
    assert digests(path.parent, [path.name])[path.name] not in found

"""Every format has one reader: it finds what the format's own readers find, within bounds."""

from __future__ import annotations

import json
import sqlite3
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag2 import Reader, StoragePlugin
from support.campaigns.bags import START, Bag, convert_alone, rows

from robovast.analysis.bags.files import BagInfo, read_bag, read_info
from robovast.analysis.bags.source import Consumer, Faults, Topic
from robovast.evaluation.bag_timeline import read_timeline
from robovast.evaluation.drive.drives import Drives
from robovast.evaluation.drive.one_file import one_file
from robovast.evaluation.drive.recording import Recording
from robovast.model.document.commands import TopicsToCsv

MAGIC = b"\x89MCAP0\r\n"
Found = list[tuple[str, int, bytes]]


def converted(folder: Path) -> tuple[Found, list[str]]:
    """Messages as the converter gets them, and warnings."""
    found: Found = []
    warnings: list[str] = []

    def subscribe(topic: Topic) -> Consumer:
        return lambda moment, data: found.append((topic.name, moment, data))

    read_bag(folder, BagInfo(), subscribe, warnings.append)
    return found, warnings


def by_mcap(path: Path) -> Found:
    with path.open("rb") as file:
        messages = NonSeekingReader(file).iter_messages(log_time_order=False)
        found = [(c.topic, m.log_time, m.data) for _, c, m in messages]
    return sorted(found, key=lambda message: message[1])


def write_mcap(path: Path, times: list[int], **options: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        writer = Writer(file, **{"chunk_size": 300, **options})
        writer.start()
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        odd = writer.register_schema("odd.Message", "protobuf", b"\xff\xfe\0\x80")
        channels = [writer.register_channel(f"/{i}", "cdr", s) for i, s in ((0, schema), (1, odd))]
        for number, moment in enumerate(times):
            data = b"\0\1\0\0" + struct.pack("<I", 9) + b"%08d\0" % number
            writer.add_message(channels[number % 2], moment, data, moment)
        writer.finish()


def records(content: bytes, *, within: bool = False) -> Iterator[tuple[int, int]]:
    """Begin of each record, and its opcode; of a chunk without compression, of those in it."""
    place = len(MAGIC)
    while place + 9 <= len(content) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", content, place)
        yield place, opcode
        place += 49 if within and opcode == 6 else 9 + length


options = st.fixed_dictionaries(
    {
        "compression": st.sampled_from(CompressionType),
        "use_chunking": st.booleans(),
        "index_types": st.sampled_from([IndexType.ALL, IndexType.NONE, IndexType.CHUNK]),
        "repeat_channels": st.booleans(),
        "use_statistics": st.booleans(),
        "use_summary_offsets": st.booleans(),
        "enable_crcs": st.booleans(),
    }
)
hypothesis_settings = settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@hypothesis_settings
@given(
    how=options,
    times=st.lists(st.integers(0, 50), min_size=1, max_size=60),
    insertions=st.lists(st.tuples(st.integers(0, 100), st.integers(0x10, 0xFF)), max_size=4),
)
def test_whatever_writes_an_mcap_file_its_messages_are_read(
    tmp_path: Path, how: dict[str, Any], times: list[int], insertions: list[tuple[int, int]]
) -> None:
    path = tmp_path / "bag" / "0.mcap"
    write_mcap(path, times, **how)
    content = path.read_bytes()
    for share, opcode in insertions:  # records of applications and of later versions
        places = [place for place, kind in records(content) if kind < 15]
        place = places[share * (len(places) - 1) // 100]
        content = content[:place] + struct.pack("<BQ", opcode, 3) + b"own" + content[place:]
    path.write_bytes(content)
    expected = by_mcap(path)
    found, warnings = converted(path.parent)
    assert found == expected
    unknown = any(opcode < 0x80 for _, opcode in insertions)
    assert all("of the unknown kind" in text for text in warnings)
    assert bool(warnings) == unknown
    played = Recording(tmp_path.resolve(), "bag")
    assert list(played.read(played.topics, 0, 100)) == [(t, n, d) for n, t, d in expected]
    timeline = read_timeline(tmp_path.resolve(), "bag")
    for topic, counts in timeline.topics.items():
        assert sum(counts) == sum(name == topic for name, _, _ in expected)


@hypothesis_settings
@given(
    how=options,
    damage=st.lists(st.tuples(st.integers(0, 9999), st.integers(0, 255)), min_size=1, max_size=5),
    end=st.integers(1000, 10_000),
)
def test_damage_costs_what_is_damaged_and_nothing_is_invented(
    tmp_path: Path, how: dict[str, Any], damage: list[tuple[int, int]], end: int
) -> None:
    path = tmp_path / "bag" / "0.mcap"
    write_mcap(path, list(range(100)), **how)
    content = bytearray(path.read_bytes())
    for share, value in damage:
        content[len(MAGIC) + share * (len(content) - len(MAGIC) - 1) // 10_000] = value
    path.write_bytes(content[: len(content) * end // 10_000])
    begin = time.monotonic()
    found, _ = converted(path.parent)
    assert [moment for _, moment, _ in found if moment < 100] == sorted(
        moment for _, moment, _ in found if moment < 100
    )
    assert time.monotonic() - begin < 20


@pytest.mark.parametrize("kind", [4, 5])
@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.NONE, IndexType.CHUNK])
@hypothesis_settings
@given(how=options, share=st.integers(0, 99), opcode=st.integers(0x70, 0xFF))
def test_no_record_of_another_kind_hides_messages_silently(
    tmp_path: Path, how: dict[str, Any], index: IndexType, kind: int, share: int, opcode: int
) -> None:
    path = tmp_path / "bag" / "0.mcap"
    fixed = {"compression": CompressionType.NONE, "enable_crcs": False, "index_types": index}
    write_mcap(path, list(range(100)), **{**how, **fixed})
    content = bytearray(path.read_bytes())
    places = [place for place, found in records(bytes(content), within=True) if found == kind]
    content[places[share * len(places) // 100]] = opcode
    path.write_bytes(content)
    found, warnings = converted(path.parent)
    assert len(found) == 100 or warnings


@pytest.mark.parametrize("has_summary", [True, False])
def test_a_chunk_whose_opcode_became_one_of_an_application_is_not_lost_silently(
    tmp_path: Path, has_summary: bool
) -> None:
    path = tmp_path / "bag" / "0.mcap"
    write_mcap(path, list(range(100)), compression=CompressionType.ZSTD)
    content = bytearray(path.read_bytes())
    found = list(records(bytes(content)))
    content[[place for place, kind in found if kind == 6][3]] |= 0x80
    end = next(place for place, kind in found if kind == 15)
    path.write_bytes(content if has_summary else content[:end])
    messages, warnings = converted(path.parent)
    assert 0 < len(messages) < 100
    wanted = "of the 100 messages in its summary" if has_summary else "records of an application"
    assert any(wanted in text for text in warnings)


def test_a_file_without_summary_continues_after_a_damaged_record(tmp_path: Path) -> None:
    path = tmp_path / "bag" / "0.mcap"
    write_mcap(path, list(range(100)), compression=CompressionType.ZSTD)
    content = bytearray(path.read_bytes())
    chunks = [place for place, kind in records(bytes(content)) if kind == 6]
    end = next(place for place, kind in records(bytes(content)) if kind == 15)
    content[chunks[3] : chunks[3] + 9] = b"\xee" * 9
    path.write_bytes(content[:end])
    found, warnings = converted(path.parent)
    assert 80 < len(found) < 100
    assert found[-1][1] == 99
    assert f"0.mcap is damaged at byte {chunks[3]}" in " ".join(warnings)


ROW = tuple[Any, Any, Any]


def write_db(path: Path, messages: list[ROW], script: str = "", number: Any = 1) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("CREATE TABLE topics (id, name, type, serialization_format)")
        row = (number, "/a", "std_msgs/msg/String", "cdr")
        database.execute("INSERT INTO topics VALUES (?, ?, ?, ?)", row)
        if script:
            database.executescript(script)
            return
        database.execute(
            "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id, timestamp, data)"
        )
        database.executemany(
            "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", messages
        )


@pytest.mark.parametrize("indexed", [True, False])
@pytest.mark.parametrize("chunked", [True, False])
def test_impossible_times_cost_their_messages_alone(
    tmp_path: Path, *, indexed: bool, chunked: bool
) -> None:
    write_mcap(
        tmp_path / "bag" / "0.mcap",
        [1, 2, 1 << 63, (1 << 64) - 1, 5, 6],
        use_chunking=chunked,
        index_types=IndexType.ALL if indexed else IndexType.NONE,
    )
    found, warnings = converted(tmp_path / "bag")
    assert [moment for _, moment, _ in found] == [1, 2, 5, 6]
    assert "messages with an impossible time" in " ".join(warnings)
    copied, _ = one_file(tmp_path, "bag", tmp_path)
    with copied.open("rb") as stream:
        count = len(list(make_reader(stream).iter_messages()))
    assert count == (6 if indexed and chunked else 4), "a whole file is its own copy"
    assert Drives(tmp_path).drive("bag", {}).overview()


def test_names_that_are_not_text_stay_distinct(tmp_path: Path) -> None:
    write_mcap(tmp_path / "bag" / "0.mcap", [1, 2])
    path = tmp_path / "bag" / "0.mcap"
    path.write_bytes(path.read_bytes().replace(b"/0", b"/\xff").replace(b"/1", b"/\xfe"))
    recording = Recording(tmp_path, "bag")
    assert sorted(recording.topics) == ["/\\xfe", "/\\xff"]
    copied, _ = one_file(tmp_path, "bag", tmp_path)
    assert copied.exists()
    json.dumps(str(Drives(tmp_path).drive("bag", {}).overview())).encode()


@pytest.mark.parametrize(
    "table",
    [
        "messages (rowid TEXT, topic_id, timestamp, data)",
        "messages (RowId INTEGER, topic_id, timestamp, data)",
        "messages (id INTEGER PRIMARY KEY, topic_id, timestamp, data) WITHOUT ROWID",
    ],
)
def test_a_table_without_numbers_of_rows_is_refused(tmp_path: Path, table: str) -> None:
    write_db(tmp_path / "bag" / "0.db3", [], f"CREATE TABLE {table}")
    found, warnings = converted(tmp_path / "bag")
    assert found == []
    assert "the rows of its table messages have no numbers" in " ".join(warnings)


@pytest.mark.parametrize(
    "odd",
    [
        (1, -5, b"x"),
        (1, 5, 3_000_000_000),
        (1, 5, "text"),
        (1, 5, None),
        (1, "soon", b"x"),
        (1, 5.5, b"x"),
        ("1) UNION SELECT 1,2,3 --", 5, b"x"),
    ],
)
def test_a_row_that_is_no_message_costs_itself(tmp_path: Path, odd: ROW) -> None:
    write_db(tmp_path / "bag" / "0.db3", [(1, 3, b"late"), odd, (1, 1, b"early")])
    found, warnings = converted(tmp_path / "bag")
    assert found == [("/a", 1, b"early"), ("/a", 3, b"late")]
    assert "0.db3: 1 rows are skipped: they do not contain messages" in warnings


@pytest.mark.parametrize("number", ["1) UNION SELECT sqlite_version(),2,3 --", b"1", 1.5, None])
def test_the_number_of_a_topic_is_never_executed(tmp_path: Path, number: object) -> None:
    write_db(tmp_path / "bag" / "0.db3", [(1, 1, b"x")], number=number)
    assert converted(tmp_path / "bag")[0] == []


ENDLESS = """
CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n)
SELECT {} FROM n
"""


@pytest.mark.parametrize(
    "script",
    [
        ENDLESS.format("1 topic_id, i timestamp, x'00' data"),
        ENDLESS.format("count(*) id, 1 topic_id, 1 timestamp"),
        "CREATE VIRTUAL TABLE messages USING fts5(topic_id, timestamp, data)",
    ],
)
def test_only_tables_hold_messages(tmp_path: Path, script: str) -> None:
    write_db(tmp_path / "bag" / "0.db3", [], script)
    begin = time.monotonic()
    found, warnings = converted(tmp_path / "bag")
    assert (found, time.monotonic() - begin < 10) == ([], True)
    assert "no table messages" in " ".join(warnings)


def test_a_value_that_a_table_computes_is_bounded(tmp_path: Path) -> None:
    script = """
    CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id, timestamp,
        data AS (zeroblob(900000000)));
    INSERT INTO messages (topic_id, timestamp) VALUES (1, 1), (1, 2);
    """
    write_db(tmp_path / "bag" / "0.db3", [], script)
    found, warnings = converted(tmp_path / "bag")
    assert found == []
    assert "skipped" in " ".join(warnings)


def test_messages_of_split_sqlite_files_are_in_order_of_time(tmp_path: Path) -> None:
    for file, moments in (("bag_0.db3", (1, 2, 7, 4)), ("bag_1.db3", (3, 9, 5))):
        write_db(tmp_path / "bag" / file, [(1, t, b"%d" % t) for t in moments])
    found, _ = converted(tmp_path / "bag")
    assert [moment for _, moment, _ in found] == [1, 2, 3, 4, 5, 7, 9]


@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_what_rosbags_writes_and_reads_is_read(tmp_path: Path, storage: StoragePlugin) -> None:
    with Bag(tmp_path / "bag", storage=storage) as bag:
        for number in range(50):
            bag.write(f"/{number % 3}", bag.make("std_msgs/msg/String", "x" * number), at=number)
    with Reader(tmp_path / "bag") as reader:
        expected = [(c.topic, at, bytes(data)) for c, at, data in reader.messages()]
    assert converted(tmp_path / "bag") == (expected, [])


def bomb(size: int) -> bytes:
    compressor = zstandard.ZstdCompressor(level=19).compressobj()
    zeros = bytes(1 << 24)
    parts = [compressor.compress(zeros) for _ in range(size >> 24)]
    return b"".join([*parts, compressor.flush()])


def chunk_bomb(path: Path, stated: int) -> None:
    data = bomb(1 << 28)
    head = struct.pack("<QQQII", 1, 2, stated, 0, 4) + b"zstd" + struct.pack("<Q", len(data))
    chunk = struct.pack("<BQ", 6, len(head) + len(data)) + head + data
    path.write_bytes(MAGIC + struct.pack("<BQII", 1, 8, 0, 0) + chunk)


def message_bomb(path: Path) -> None:
    path.unlink(missing_ok=True)
    write_db(path.with_suffix(".db3"), [(1, 1, bomb(1 << 28))])


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda path: chunk_bomb(path, 1 << 28), "larger than 67108864 bytes"),
        (lambda path: chunk_bomb(path, 1000), "larger than 1000 bytes"),
        (message_bomb, "larger than 67108864 bytes"),
    ],
)
def test_few_bytes_that_stand_for_many_are_left_out(
    tmp_path: Path, make: Callable[[Path], None], said: str
) -> None:
    (tmp_path / "bag").mkdir()
    make(tmp_path / "bag" / "0.mcap")
    found, warnings = converted(tmp_path / "bag")
    assert found == []
    assert said in " ".join(warnings)


@pytest.mark.parametrize("ending", [".zstd", ".zst"])
def test_a_compressed_file_is_read_within_bounds(
    tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_mcap(tmp_path / "bag" / "0.mcap", list(range(100)))
    plain = tmp_path / "bag" / "0.mcap"
    expected = by_mcap(plain)
    content = plain.read_bytes()
    plain.unlink()
    packed = tmp_path / "bag" / f"0.mcap{ending}"
    packed.write_bytes(zstandard.compress(content[:500]) + zstandard.compress(content[500:]))
    assert converted(tmp_path / "bag") == (expected, [])
    monkeypatch.setattr("robovast.analysis.bags.zstd._FEW", 1 << 20)
    packed.write_bytes(bomb(1 << 26))
    found, warnings = converted(tmp_path / "bag")
    assert found == []
    assert f"{packed.name} is read only up to 1 MiB of its content" in " ".join(warnings)


META = "rosbag2_bagfile_information: "


@pytest.mark.parametrize(
    "text",
    [
        "{relative_file_paths: [1]}",
        "{relative_file_paths: 3}",
        "{topics_with_message_count: [1]}",
        "{topics_with_message_count: [{topic_metadata: {name: 1}}]}",
        "{topics_with_message_count: {a: b}}",
        "{ros_distro: [jazzy]}",
        "[]",
        "text",
        "&a [*a]",
    ],
)
def test_metadata_that_are_malformed_cost_themselves(tmp_path: Path, text: str) -> None:
    write_mcap(tmp_path / "bag" / "0.mcap", list(range(10)))
    (tmp_path / "bag" / "metadata.yaml").write_text(META + text)
    done = convert_alone(tmp_path / "bag", TopicsToCsv(topics=["/0"]))
    assert len(rows(tmp_path / "bag_0.csv")) == 5
    (warning,) = done.warnings
    assert warning.startswith("bag/metadata.yaml cannot be read: ")
    assert "\n" not in warning


def test_metadata_tell_the_types_of_channels_without_schema(tmp_path: Path) -> None:
    path = tmp_path / "bag" / "0.mcap"
    path.parent.mkdir()
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/a", "cdr", 0)
        writer.add_message(channel, START, b"\0\1\0\0\7\0\0\0", START)
        writer.finish()
    topic = "{topic_metadata: {name: /a, type: std_msgs/msg/Int32}, message_count: 1}"
    (tmp_path / "bag" / "metadata.yaml").write_text(
        f"{META}{{ros_distro: null, topics_with_message_count: [{topic}]}}"
    )
    assert read_info(path.parent, pytest.fail).topics == {"/a": "std_msgs/msg/Int32"}
    done = convert_alone(tmp_path / "bag", TopicsToCsv(topics=["/a"]))
    assert done.warnings == []
    assert rows(tmp_path / "bag_a.csv")[0]["data"] == "7"


def test_no_fault_is_lost_without_a_word() -> None:
    faults = Faults()
    for number in range(30):
        faults.add(f"record {number} is left out")
        faults.add(f"record {number} is left out")
    assert len(faults) == 21
    assert faults[-1] == "More than 20 parts of a file of the bag cannot be read"

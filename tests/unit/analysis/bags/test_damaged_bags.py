"""Of a bag that is not whole, what can be read is converted, and the rest is stated."""

import random
import resource
import sqlite3
import struct
from collections.abc import Iterator
from hashlib import sha512
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from support.campaigns.bags import START, Bag, convert_alone, rows

from robovast.analysis.bags import order
from robovast.analysis.bags.convert import Conversion
from robovast.model.document.commands import TopicsToCsv

COUNT = 200
TEXT = "std_msgs/msg/String"
MCAP, SQLITE = StoragePlugin.MCAP, StoragePlugin.SQLITE3


def record(folder: Path, storage: StoragePlugin = MCAP) -> Path:
    """A bag of short texts; its file with messages."""
    with Bag(folder, storage=storage) as bag:
        for number in range(COUNT):
            bag.write("/a", bag.make(TEXT, f"text {number} {'x' * 200}"), at=number)
    (file,) = [path for path in folder.iterdir() if path.name != "metadata.yaml"]
    return file


def record_chunks(file: Path, compression: CompressionType) -> None:
    """An MCAP file of many chunks, with checksums."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=4096, compression=compression)
        writer.start()
        schema = writer.register_schema(TEXT, "ros2msg", b"string data")
        channel = writer.register_channel("/a", "cdr", schema)
        for number in range(COUNT):
            noise = "".join(sha512(f"{number} {part}".encode()).hexdigest() for part in "ab")
            text = f"text {number} {noise}".encode() + b"\0"
            data = b"\0\1\0\0" + len(text).to_bytes(4, "little") + text
            writer.add_message(channel, START + number, data, START + number)
        writer.finish()


def convert(folder: Path) -> Conversion:
    return convert_alone(folder, TopicsToCsv(topics=["/a"]))


def numbers(folder: Path) -> list[int]:
    table = rows(folder.parent / f"{folder.name}_a.csv")
    return [int(row["data"].split()[1]) for row in table]


@pytest.mark.parametrize("storage", [MCAP, SQLITE])
@pytest.mark.parametrize("content", [b"", b"nonsense" * 100])
def test_a_file_without_content_is_stated(
    tmp_path: Path, storage: StoragePlugin, content: bytes
) -> None:
    file = record(tmp_path / "rosbag2", storage)
    file.write_bytes(content)
    done = convert(tmp_path / "rosbag2")
    assert any(file.name in warning for warning in done.warnings)
    assert "rosbag2 has no message on /a" in done.warnings
    assert done.outputs == []


def test_a_bag_without_messages_is_stated(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2"):
        pass
    done = convert(tmp_path / "rosbag2")
    assert done.warnings == ["rosbag2 has no message on /a"]


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_an_mcap_file_that_is_cut_off_is_read_up_to_there(
    tmp_path: Path, compression: CompressionType, share: float
) -> None:
    file = tmp_path / "rosbag2" / "rosbag2_0.mcap"
    record_chunks(file, compression)
    whole = file.read_bytes()
    file.write_bytes(whole[: int(len(whole) * share)])

    done = convert(file.parent)

    read = numbers(file.parent)
    assert read == list(range(len(read)))
    assert COUNT * (share - 0.2) < len(read) <= COUNT
    assert any("rosbag2_0.mcap" in warning for warning in done.warnings)


@pytest.mark.parametrize("compression", list(CompressionType))
def test_only_the_damaged_chunk_is_lost(tmp_path: Path, compression: CompressionType) -> None:
    file = tmp_path / "rosbag2" / "rosbag2_0.mcap"
    record_chunks(file, compression)
    with file.open("rb") as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[3]
    content = bytearray(file.read_bytes())
    middle = chunk.chunk_start_offset + chunk.chunk_length // 2
    content[middle] ^= 0xFF
    file.write_bytes(content)

    done = convert(file.parent)

    lost = set(range(COUNT)) - set(numbers(file.parent))
    assert 0 < len(lost) < COUNT // 5
    assert any(f"byte {chunk.chunk_start_offset}" in warning for warning in done.warnings)


def test_after_a_damaged_length_reading_goes_on_at_the_next_chunk(tmp_path: Path) -> None:
    file = tmp_path / "rosbag2" / "rosbag2_0.mcap"
    record_chunks(file, CompressionType.NONE)
    with file.open("rb") as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[3]
    content = bytearray(file.read_bytes())
    content[chunk.chunk_start_offset : chunk.chunk_start_offset + 9] = b"\xee" * 9
    file.write_bytes(content)

    done = convert(file.parent)

    read = numbers(file.parent)
    assert read[0] == 0
    assert read[-1] == COUNT - 1
    assert COUNT * 0.8 < len(read) <= COUNT
    assert any("is damaged" in warning for warning in done.warnings)


def test_a_record_of_gigabytes_is_no_record(tmp_path: Path) -> None:
    folder = tmp_path / "rosbag2"
    folder.mkdir()
    with (folder / "a.mcap").open("wb") as file:
        file.write(b"\x89MCAP0\r\n" + b"\x06" + (2 << 30).to_bytes(8, "little"))
        file.truncate(3 << 30)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    warnings = convert(folder).warnings
    assert any("a.mcap is damaged" in warning for warning in warnings), warnings
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1 << 20, "KiB"


def test_an_sqlite_file_that_is_cut_off_is_read_up_to_there(tmp_path: Path) -> None:
    file = record(tmp_path / "rosbag2", SQLITE)
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) * 2 // 3])
    done = convert(tmp_path / "rosbag2")
    read = numbers(tmp_path / "rosbag2")
    assert read == sorted(set(read))
    assert len(read) > COUNT // 4
    assert any("is damaged" in warning for warning in done.warnings)


def test_messages_in_the_log_of_a_database_are_read(tmp_path: Path) -> None:
    file = record(tmp_path / "rosbag2", SQLITE)
    database = sqlite3.connect(file)
    database.execute("PRAGMA journal_mode=WAL")
    last = START + 10_000_000_000
    database.execute("DELETE FROM messages WHERE timestamp > ?", [last])
    database.commit()
    content = {path.name: path.read_bytes() for path in file.parent.iterdir()}
    database.close()
    for name, data in content.items():
        (file.parent / name).write_bytes(data)
    convert(tmp_path / "rosbag2")
    assert numbers(tmp_path / "rosbag2") == list(range(11))


@pytest.mark.parametrize("storage", [MCAP, SQLITE])
def test_a_bag_without_metadata_is_read(tmp_path: Path, storage: StoragePlugin) -> None:
    record(tmp_path / "rosbag2", storage)
    (tmp_path / "rosbag2" / "metadata.yaml").unlink()
    done = convert(tmp_path / "rosbag2")
    assert len(numbers(tmp_path / "rosbag2")) == COUNT
    assert done.warnings == ["rosbag2 has no metadata.yaml: its recorder was stopped while writing"]


@pytest.mark.parametrize("text", ["", "[1, 2", "a: 1", "rosbag2_bagfile_information: 3"])
def test_metadata_that_is_nonsense_is_stated(tmp_path: Path, text: str) -> None:
    record(tmp_path / "rosbag2")
    (tmp_path / "rosbag2" / "metadata.yaml").write_text(text)
    done = convert(tmp_path / "rosbag2")
    assert len(numbers(tmp_path / "rosbag2")) == COUNT
    assert [warning.split(" cannot")[0] for warning in done.warnings] == ["rosbag2/metadata.yaml"]


def test_messages_are_in_order_of_time_and_of_the_numbers_of_files(tmp_path: Path) -> None:
    for number in (10, 9, 2):
        file = tmp_path / "rosbag2" / f"rosbag2_{number}.mcap"
        record_chunks(file, CompressionType.NONE)
    file.write_bytes(b"")
    done = convert(tmp_path / "rosbag2")
    assert numbers(tmp_path / "rosbag2") == [n for n in range(COUNT) for _ in range(2)]
    assert "rosbag2_2.mcap is empty (0 bytes)" in done.warnings


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    file = record(tmp_path / "rosbag2")
    file.unlink()
    done = convert(tmp_path / "rosbag2")
    assert f"rosbag2/{file.name} is missing" in done.warnings


@pytest.mark.parametrize("storage", [MCAP, SQLITE])
@pytest.mark.parametrize("seed", range(8))
def test_no_damage_is_a_traceback(tmp_path: Path, storage: StoragePlugin, seed: int) -> None:
    file = record(tmp_path / "rosbag2", storage)
    chance = random.Random(seed)  # noqa: S311
    content = bytearray(file.read_bytes())
    for _ in range(30):
        content[chance.randrange(len(content))] = chance.randrange(256)
    file.write_bytes(content)
    done = convert(tmp_path / "rosbag2")
    assert {output.path.name for output in done.outputs} <= {"rosbag2_a.csv"}


def write_parts(file: Path, topic: str, start: int, count: int, **options: object) -> None:
    """An MCAP file of small chunks with numbers."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=300, **options)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/Int32", "ros2msg", b"int32 data")
        channel = writer.register_channel(topic, "cdr", schema)
        for number in range(start, start + count):
            data = b"\0\1\0\0" + number.to_bytes(4, "little")
            writer.add_message(channel, START + number, data, START + number)
        writer.finish()


def records(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Place, opcode and length of the records of a whole file."""
    place = 8
    while place < len(content) - 8:
        opcode, length = struct.unpack_from("<BQ", content, place)
        yield place, opcode, length
        place += 9 + length


def read_numbers(folder: Path, topic: str) -> tuple[list[int], list[str]]:
    """The numbers on a topic of a bag, and the warnings."""
    done = convert_alone(folder, TopicsToCsv(topics=[f"/{topic}"]))
    path = folder.parent / f"{folder.name}_{topic}.csv"
    found = [int(row["data"]) for row in rows(path)] if path.exists() else []
    return found, [text for text in done.warnings if "metadata.yaml" not in text]


@settings(max_examples=60, deadline=None)
@given(
    opcode=st.integers(0, 255).filter(lambda opcode: opcode != 6),
    chance=st.randoms(use_true_random=False),
    compression=st.sampled_from(CompressionType),
    crcs=st.booleans(),
)
def test_no_changed_opcode_loses_messages_without_a_warning(
    tmp_path_factory: pytest.TempPathFactory,
    opcode: int,
    chance: random.Random,
    compression: CompressionType,
    crcs: bool,
) -> None:
    file = tmp_path_factory.mktemp("t") / "bag" / "bag_0.mcap"
    write_parts(file, "/n", 0, COUNT, compression=compression, enable_crcs=crcs)
    content = bytearray(file.read_bytes())
    chunks = [place for place, code, _ in records(content) if code == 6]
    content[chance.choice(chunks)] = opcode
    file.write_bytes(content)
    found, warnings = read_numbers(file.parent, "n")
    assert set(found) <= set(range(COUNT))
    assert len(found) > COUNT * 0.8
    assert found == list(range(COUNT)) or warnings


@settings(max_examples=60, deadline=None)
@given(opcode=st.integers(0, 127), number=st.integers(0, COUNT - 1), chunks=st.booleans())
def test_no_changed_opcode_of_a_message_is_silent(
    tmp_path_factory: pytest.TempPathFactory, opcode: int, number: int, chunks: bool
) -> None:
    file = tmp_path_factory.mktemp("t") / "bag" / "bag_0.mcap"
    options = {"compression": CompressionType.NONE, "enable_crcs": False, "use_chunking": chunks}
    write_parts(file, "/n", 0, COUNT, **options)
    content = bytearray(file.read_bytes())
    message = b"\0\1\0\0" + number.to_bytes(4, "little")
    content[content.index(message) - 22 - 9] = opcode
    file.write_bytes(content)
    found, warnings = read_numbers(file.parent, "n")
    assert set(range(COUNT)) - {number} <= set(found)
    assert len(found) == COUNT or warnings


@settings(max_examples=40, deadline=None)
@given(
    counts=st.lists(st.integers(1, 60), min_size=2, max_size=4),
    topics=st.permutations("abcd"),
    cut=st.integers(0, 60),
    compression=st.sampled_from(CompressionType),
)
@example(counts=[1, 1, 35, 38], topics=list("abcd"), cut=17, compression=CompressionType.NONE)
def test_appended_recordings_are_read_with_their_own_topics(
    tmp_path_factory: pytest.TempPathFactory,
    counts: list[int],
    topics: list[str],
    cut: int,
    compression: CompressionType,
) -> None:
    """Each has its own numbers of channels; the first ones may lack their ends."""
    file = tmp_path_factory.mktemp("t") / "bag" / "bag_0.mcap"
    content = b""
    for number, count in enumerate(counts):
        content = content[: len(content) - cut]
        write_parts(file, f"/{topics[number]}", number * 100, count, compression=compression)
        content += file.read_bytes()
    file.write_bytes(content)
    for number, count in enumerate(counts):
        found, warnings = read_numbers(file.parent, topics[number])
        assert found == list(range(number * 100, number * 100 + count))
        assert "appended" in " ".join(warnings)


@settings(max_examples=60, deadline=None)
@given(
    first=st.sets(st.integers(0, 30), min_size=1),
    second=st.sets(st.integers(0, 30), min_size=1),
    start=st.integers(0, 40),
    end=st.integers(0, 40),
    index=st.booleans(),
)
def test_wrong_times_of_a_chunk_do_not_change_the_order_without_a_warning(
    tmp_path_factory: pytest.TempPathFactory,
    first: set[int],
    second: set[int],
    start: int,
    end: int,
    index: bool,
) -> None:
    folder = tmp_path_factory.mktemp("t") / "bag"
    for name, numbers_ in (("a", first), ("b", second)):
        folder.mkdir(exist_ok=True)
        with (folder / f"{name}.mcap").open("wb") as stream:
            writer = McapWriter(stream, index_types=IndexType.ALL if index else IndexType.NONE)
            writer.start()
            schema = writer.register_schema("std_msgs/msg/Int32", "ros2msg", b"int32 data")
            channel = writer.register_channel("/n", "cdr", schema)
            for number in sorted(numbers_):
                at = START + number
                writer.add_message(channel, at, b"\0\1\0\0" + number.to_bytes(4, "little"), at)
            writer.finish()
    content = bytearray((folder / "a.mcap").read_bytes())
    (chunk,) = (place for place, code, _ in records(content) if code == 6)
    struct.pack_into("<QQ", content, chunk + 9, START + start, START + end)
    (folder / "a.mcap").write_bytes(content)
    found, warnings = read_numbers(folder, "n")
    right = sorted([*first, *second])
    assert sorted(found) == right
    assert found == right or "not in order of time" in " ".join(warnings)
    assert not index or found == right


def test_a_file_may_end_at_any_byte_of_its_summary(tmp_path: Path) -> None:
    file = tmp_path / "bag" / "bag_0.mcap"
    write_parts(file, "/n", 0, 10)
    content = file.read_bytes()
    (end,) = (place for place, opcode, _ in records(content) if opcode == 0x0F)
    for size in range(end, len(content)):
        file.write_bytes(content[:size])
        found, warnings = read_numbers(file.parent, "n")
        assert found == list(range(10))
        assert "bag_0.mcap has no end: its recorder was stopped while writing" in warnings


@pytest.mark.parametrize("storage", [MCAP, SQLITE])
@pytest.mark.parametrize("size", [3, 40_000], ids=["one block", "many blocks"])
@pytest.mark.parametrize("back", [0.5, 100.0])
def test_times_of_receipt_that_jump_back_are_reported(
    tmp_path: Path, storage: StoragePlugin, size: int, back: float
) -> None:
    with Bag(tmp_path / "rosbag2", storage=storage) as bag:
        for number in range(COUNT):
            at = number - (back if number >= COUNT // 2 else 0)
            bag.write("/a", bag.make(TEXT, f"text {number} {'x' * size}"), at=at)
    warnings = convert(tmp_path / "rosbag2").warnings
    assert len(numbers(tmp_path / "rosbag2")) == COUNT
    jumps = [text for text in warnings if text.startswith("The times of receipt in a file")]
    assert len(jumps) == (back > 1)
    assert warnings == jumps


@pytest.mark.parametrize("mode", [CompressionMode.MESSAGE, CompressionMode.STORAGE])
def test_a_few_bytes_do_not_expand_to_any_size(
    tmp_path: Path, mode: CompressionMode, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(order, "_LEAST_ROOM", 1 << 20)
    with Bag(tmp_path / "rosbag2", compression=mode) as bag:
        for number in range(COUNT):
            bag.write("/a", bag.make(TEXT, f"text {number} {'x' * 300_000}"), at=number)
    (warning,) = convert(tmp_path / "rosbag2").warnings
    assert "are far larger than the file: the following messages are skipped" in warning
    assert 0 < len(numbers(tmp_path / "rosbag2")) < COUNT

"""A bag as one whole MCAP file, for other viewers: its own, or a copy of what can be read."""

from __future__ import annotations

from pathlib import Path

from mcap.writer import Writer

from robovast.analysis.bags.mcap_file import McapFile
from robovast.evaluation.confined_files import resolved
from robovast.evaluation.drive.recording import Recording


def one_file(results: Path, bag: str, folder: Path) -> tuple[Path, list[str]]:
    """An MCAP file with an index that has all messages of a bag, and what it lacks.

    Args:
        results: the results folder.
        bag: the bag's folder, relative to it.
        folder: for a copy, if the bag has several files, other files, or one without an end.

    Raises:
        InputError: nothing in the bag can be read.
    """
    recording = Recording(results, bag)
    faults = recording.all_faults()
    match recording.files:
        case [McapFile() as file] if file.indexed_chunks and not faults:
            return resolved(results, f"{bag}/{file.name}"), []
    return _copy(recording, folder / "recording.mcap"), recording.all_faults()


def _copy(recording: Recording, path: Path) -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        channels = {}
        for name, topic in recording.topics.items():
            defined = topic.definition
            text = defined.text.encode("utf-8", "surrogateescape")
            schema = writer.register_schema(defined.type, defined.encoding, text)
            channels[name] = writer.register_channel(name, topic.serialization, schema)
        for message in recording.read(channels, recording.start, recording.end + 1):
            writer.add_message(channels[message.topic], message.time, message.data, message.time)
        writer.finish()  # type: ignore[no-untyped-call]
    return path

"""Compares the outputs of two executions of one run: equal, or the first difference."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from hashlib import blake2b
from itertools import zip_longest
from math import isclose
from pathlib import Path, PurePosixPath
from typing import BinaryIO, TextIO

from robovast.analysis.provenance.reading import list_files
from robovast.base.optional_deps import ROS
from robovast.base.safe_paths import MOST, open_file, read_file, refuse_holes
from robovast.base.yaml_files import parse_yaml
from robovast.campaign.layout import OWN_NAMES, POSTPROCESSING
from robovast.model.document.execution import Output

ALL_TABLES = (Output(pattern="*.csv"),)
"""What is compared when nobody says what."""

_BAGS = (".mcap", ".mcap.zstd", ".mcap.zst", ".db3", ".db3.zstd", ".db3.zst")
"""Endings of files that have topics."""
_BLOCK = 1 << 20
_LONGEST = 60
"""Longest value in a message [characters]."""


@dataclass(frozen=True)
class OutputComparison:
    """How the outputs of an execution compare with those of another one."""

    same: tuple[str, ...]
    """Outputs that are the same."""
    differences: tuple[str, ...]
    """Of each other output the first difference, for people."""


def compare_outputs(before: Path, now: Path, outputs: Sequence[Output]) -> OutputComparison:
    """Compare outputs in the folders of two runs.

    Files that postprocessing has made count on neither side.

    Args:
        before: folder of the run that is repeated.
        now: folder of the repetition.
        outputs: what to compare.

    Raises:
        CannotRunError: messages are to be compared without the extra `ros`.
    """
    there = {folder: _files(folder) for folder in (before, now)}
    same, differences = [], []
    for output in outputs:
        for path in sorted(p for p in there[before] | there[now] if _matches(p, output)):
            found = [path in there[folder] for folder in (before, now)]
            name = path + (f":{output.topic}" if output.topic else "")
            difference = (
                _difference(before, now, path, output)
                if all(found)
                else f"is {'missing' if found[0] else 'new'}"
            )
            if difference is None:
                same.append(name)
            else:
                differences.append(f"{name} {difference}")
    return OutputComparison(tuple(dict.fromkeys(same)), tuple(dict.fromkeys(differences)))


def _matches(path: str, output: Output) -> bool:
    is_bag = path.endswith(_BAGS)
    return PurePosixPath(path).match(output.files) and (is_bag or not output.topic)


def _files(run: Path) -> frozenset[str]:
    """What a run wrote itself."""
    own = set(list_files(str(run), "")) - {*OWN_NAMES, POSTPROCESSING}
    return frozenset(own - set(_derived(run)))


def _derived(run: Path) -> Iterator[str]:
    """What postprocessing made of a run, relative to it."""
    try:
        record = parse_yaml(read_file(run / POSTPROCESSING, run))
    except (OSError, ValueError):
        return
    entries = record.get("entries") if isinstance(record, dict) else None
    prefix = f"{run.parent.name}/{run.name}/"
    for entry in entries if isinstance(entries, list) else ():
        if isinstance(entry, dict):
            yield str(entry.get("output")).rpartition(prefix)[2]


def _difference(before: Path, now: Path, path: str, output: Output) -> str | None:
    """The first difference of two outputs; None when they are the same."""
    try:
        for folder in (before, now):
            with open_file(folder / path, folder) as file:
                refuse_holes(file)
        if output.topic:
            return _first_message(before / path, now / path, output.topic)
        return _first_in_files((before, now), path, output.tolerance)
    except (OSError, csv.Error) as error:
        return f"cannot be compared: {getattr(error, 'strerror', None) or error}"


def _first_in_files(folders: tuple[Path, Path], path: str, tolerance: float) -> str | None:
    one, other = (open_file(folder / path, folder) for folder in folders)
    with one, other:
        byte = _first_byte(one, other)
    if byte is None:
        return None
    if not path.endswith(".csv"):
        return f"differs from byte {byte}"
    old, new = (io.TextIOWrapper(open_file(f / path, f), "utf-8", "replace", "") for f in folders)
    with old, new:
        return _first_cell(_rows(old), _rows(new), tolerance)


def _first_byte(one: BinaryIO, other: BinaryIO) -> int | None:
    """Offset of the first byte that differs."""
    offset = 0
    while True:
        left, right = one.read(_BLOCK), other.read(_BLOCK)
        if left != right:
            pairs = enumerate(zip_longest(left, right))
            return offset + next(index for index, (a, b) in pairs if a != b)
        if not left:
            return None
        offset += len(left)


def _rows(file: TextIO) -> Iterator[list[str]]:
    """The rows of a table.

    Raises:
        csv.Error: one has more than `MOST` characters, or is no row.
    """
    room = MOST

    def lines() -> Iterator[str]:
        nonlocal room
        while line := file.readline(room + 1):
            room -= len(line)
            if room < 0:
                raise csv.Error(f"a row has more than {MOST} characters")
            yield line

    for row in csv.reader(lines()):
        yield row
        room = MOST


def _first_cell(
    before: Iterable[list[str]], now: Iterable[list[str]], tolerance: float
) -> str | None:
    """The first cell of two tables that differs by more than a tolerance."""
    header: list[str] = []
    for line, (old, new) in enumerate(zip_longest(before, now), 1):
        if old is None or new is None:
            return f"has {'fewer' if new is None else 'more'} rows: it differs from row {line}"
        header = header or old
        cells = enumerate(zip_longest(old, new))
        column = next((n for n, (a, b) in cells if not _is_same(a, b, tolerance)), None)
        if column is not None:
            name = header[column] if column < len(header) else str(column + 1)
            was, is_ = (_shown(row, column) for row in (old, new))
            return f"differs in row {line}, column {name[:_LONGEST]}: {is_} instead of {was}"
    return None


def _is_same(old: str | None, new: str | None, tolerance: float) -> bool:
    if old == new or old is None or new is None:
        return old == new
    try:
        return tolerance > 0 and isclose(float(old), float(new), rel_tol=0, abs_tol=tolerance)
    except ValueError:
        return False


def _shown(row: Sequence[str], column: int) -> str:
    return row[column][:_LONGEST] if column < len(row) else "nothing"


def _first_message(before: Path, now: Path, topic: str) -> str | None:
    """The first message on a topic whose bytes differ; the time of its receipt does not count."""
    old, new = _messages(before, topic), _messages(now, topic)
    if not old and not new:
        return f"cannot be compared: neither has a message on {topic}"
    for number, (a, b) in enumerate(zip_longest(old, new), 1):
        if a is None or b is None:
            return f"has {len(new)} messages instead of {len(old)}"
        if a != b:
            return f"differs from message {number} of {len(old)}"
    return None


def _messages(path: Path, topic: str) -> list[bytes]:
    """Digests of the messages on a topic, in order."""
    with ROS.needed_by("Comparing the messages of bags"):
        from robovast.analysis.bags.files import read_files
        from robovast.analysis.bags.source import Consumer, Topic
    found: list[bytes] = []

    def subscribe(described: Topic) -> Consumer | None:
        return keep if described.name == topic else None

    def keep(_: int, message: bytes) -> None:
        found.append(blake2b(message, digest_size=16).digest())

    read_files([path], {}, subscribe, lambda _: None)
    return found

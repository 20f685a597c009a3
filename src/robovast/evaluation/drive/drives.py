"""Recorded drives: what they have, and their parts."""

from __future__ import annotations

import math
import os
from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from threading import Lock

from robovast.base.errors import InputError
from robovast.evaluation.confined_files import resolved
from robovast.evaluation.drive.clock import Clock, make_clock
from robovast.evaluation.drive.ground import Ground, recorded_ground
from robovast.evaluation.drive.motion import UNDECODABLE, decoder, stamp_of
from robovast.evaluation.drive.part import DriveSource, Part, PartReader
from robovast.evaluation.drive.pictures import Pictures, read_pictures
from robovast.evaluation.drive.recording import RecordedMessage, Recording
from robovast.evaluation.drive.roles import FIXED, TRANSFORMS, cast

_PART = 10.0
"""Length of a part [s]"""
_PART_BYTES = 12 << 20
"""What is read of a bag for a part, about [bytes]."""
_SHORTEST, _MOST_PARTS = 0.5, 2000
_SAMPLES = 16
"""Messages whose stamps are compared with their times of receipt."""
_CLOSE = 100
"""The same of the last messages, as a short recording has no others."""
_MOST_FIXED = 2000
_KEPT = 4
"""Recordings whose index is kept."""
_PATIENCE = 30.0
"""How long a request waits for another that opens the same bag [s]."""


@dataclass(frozen=True)
class Overview:
    """What a recorded drive has."""

    duration: float
    """Length of the time line [s]"""
    started: float
    """[s since the epoch]"""
    simulated: bool
    """Whether the time line is that of the simulation."""
    bounds: list[float]
    """Where parts begin, and where the last one ends [s]."""
    topics: Mapping[str, str]
    """Topics by role"""
    remarks: list[str]
    """What is missing or cannot be read."""


class Drive:
    """The recording of one drive; it is read anew for every part, so threads may share it."""

    def __init__(self, recording: Recording, named: Mapping[str, str]) -> None:
        self._recording = recording
        types = {name: topic.type for name, topic in recording.topics.items()}
        self._cast = cast(types, named)
        clock = _clock_of(recording, self._cast.topics.get("pose"))
        fixed: Iterable[RecordedMessage] = ()
        transforms = self._cast.transforms
        if types.get(transforms + FIXED) == TRANSFORMS:
            fixed = recording.held([transforms + FIXED], recording.start, recording.end + 1)
        kept = list(islice(fixed, _MOST_FIXED))
        self._source = DriveSource(recording, clock, self._cast.topics, transforms, kept)
        self._bounds = _bounds(clock.end, recording.size(self._cast.topics.values()))

    def overview(self) -> Overview:
        """What the drive has."""
        clock = self._source.clock
        return Overview(
            duration=clock.end,
            started=self._recording.start / 1e9,
            simulated=clock.first_stamp is not None,
            bounds=self._bounds,
            topics=self._cast.topics,
            remarks=[*self._cast.missing, *clock.remarks, *self._recording.all_faults()],
        )

    def part(self, number: int, *, scans: bool) -> Part:
        """One part.

        Args:
            number: its number, from 0.
            scans: whether it has what the laser saw.

        Raises:
            InputError: there is no such part.
        """
        return PartReader(self._source, *self._span(number)).read(scans=scans)

    def pictures(self, number: int) -> Pictures:
        """What the camera saw in one part; nothing without a camera.

        Args:
            number: the part's number, from 0.

        Raises:
            InputError: there is no such part.
        """
        start, end = self._span(number)
        topic = self._cast.topics.get("camera")
        if topic is None:
            return Pictures()
        messages = self._recording.read([topic], start, end)
        decode = decoder(self._recording.topics[topic])
        return read_pictures(topic, messages, decode, self._source.clock)

    def _span(self, number: int) -> tuple[int, int]:
        """When the messages of a part were received: from … to before [ns].

        Raises:
            InputError: there is no such part.
        """
        count = len(self._bounds) - 1
        if not 0 <= number < count:
            raise InputError(f"The drive has no part {number}.")
        receipt = self._source.clock.receipt
        last = number == count - 1
        end = self._recording.end + 1 if last else receipt(self._bounds[number + 1])
        return receipt(self._bounds[number]), end

    def ground(self) -> Ground | None:
        """The map that was recorded last; None if none was.

        Raises:
            InputError: it cannot be shown.
        """
        topic = self._cast.topics.get("map")
        found = self._recording.before(topic, self._recording.end + 1) if topic else []
        if topic is None or not found:
            return None
        try:
            return recorded_ground(decoder(self._recording.topics[topic])(found[-1]))
        except UNDECODABLE as error:
            raise InputError(f"{topic} has no valid map: {error}.") from None


def _clock_of(recording: Recording, topic: str | None) -> Clock:
    stamps: list[tuple[int, int]] = []
    if topic and recording.topics[topic].type != TRANSFORMS:
        end = recording.end + 1
        moments = recording.moments(topic)
        for moment in moments[:: max(1, len(moments) // _SAMPLES)]:
            stamps += _stamps(list(islice(recording.read([topic], moment, end), 1)))
        last = recording.before(topic, end)
        stamps += _stamps(last[-1 :: -max(1, len(last) // _CLOSE)])
    return make_clock(recording.start, recording.end, recording.recorded(), sorted(stamps))


def _stamps(messages: Sequence[RecordedMessage]) -> list[tuple[int, int]]:
    found = ((message.time, stamp_of(message.data)) for message in messages)
    return [(received, stamp) for received, stamp in found if stamp is not None]


def _bounds(end: float, size: int) -> list[float]:
    """Equal parts, shorter where much is to be read."""
    wanted = max(end / _PART, min(size / _PART_BYTES, end / _SHORTEST))
    count = min(max(1, math.ceil(wanted)), _MOST_PARTS)
    return [round(end * number / count, 3) for number in range(count + 1)]


@dataclass
class _Kept:
    """A drive that is opened once, by the first who asks."""

    lock: Lock = field(default_factory=Lock)
    drive: Drive | None = None


class Drives:
    """Recorded drives of a results folder; thread-safe."""

    def __init__(self, results: Path) -> None:
        self._results = results
        self._kept: OrderedDict[tuple[object, ...], _Kept] = OrderedDict()
        self._lock = Lock()

    def drive(self, bag: str, named: Mapping[str, str]) -> Drive:
        """The drive that a bag holds.

        Args:
            bag: the bag's folder, relative to the results.
            named: topics by role, in place of guessed ones.

        Raises:
            InputError: there is no such bag, or nothing in it can be read.
        """
        folder = resolved(self._results, bag)
        files = sorted(folder.iterdir()) if os.path.isdir(folder) else []
        states = tuple((file.name, *_state(file)) for file in files)
        key = (bag, tuple(sorted(named.items())), states)
        kept = self._keep(key)
        if not kept.lock.acquire(timeout=_PATIENCE):  # several parts are asked for at once
            raise InputError(
                f"{bag} is still being searched for another request", hint="try again later"
            )
        try:
            kept.drive = kept.drive or Drive(Recording(self._results, bag), named)
            return kept.drive
        finally:
            kept.lock.release()

    def _keep(self, key: tuple[object, ...]) -> _Kept:
        with self._lock:
            kept = self._kept.setdefault(key, _Kept())
            self._kept.move_to_end(key)
            while len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
            return kept


def _state(file: Path) -> tuple[int, int]:
    state = file.lstat()
    return state.st_size, state.st_mtime_ns

"""Pictures of the robot's camera, as they were recorded."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

from robovast.evaluation.drive.clock import Clock
from robovast.evaluation.drive.motion import UNDECODABLE, Decoder, stamp_of
from robovast.evaluation.drive.picture_size import size_of
from robovast.evaluation.drive.recording import RecordedMessage

_RATE = 10.0
"""How many are shown, at most [1/s]."""
_TOLERANCE = 0.01
"""How much earlier than that the next one may come [s]."""
_MOST_BYTES = 32 << 20
"""Of the pictures of one part."""
_MOST_PIXELS = 1 << 25
"""Of one picture: a browser takes four bytes or more for each, whatever its file has."""


@dataclass
class Pictures:
    """The pictures of one part of a drive."""

    frames: list[tuple[float, str, int]] = field(default_factory=list)
    """Of each picture its place on the time line [s], its media type and its size [bytes]."""
    remarks: list[str] = field(default_factory=list)
    content: list[bytes] = field(default_factory=list, repr=False)
    """The pictures themselves"""


def read_pictures(
    topic: str, messages: Iterable[RecordedMessage], decode: Decoder, clock: Clock
) -> Pictures:
    """The pictures of a topic's messages, no more of them than are shown."""
    found = Pictures()
    shown: list[tuple[float, str, bytes]] = []
    last, damaged, large, left = -math.inf, 0, 0, _MOST_BYTES
    for message in messages:
        place = clock.at(message.time, stamp_of(message.data))
        if abs(place - last) < 1 / _RATE - _TOLERANCE:
            continue
        try:
            data, (media_type, width, height) = _picture(decode, message)
        except UNDECODABLE:
            damaged += 1
            continue
        if width * height > _MOST_PIXELS:
            large += 1
            continue
        left -= len(data)
        if left < 0:
            found.remarks.append(
                f"{topic} has large images, so some are skipped after {place:.0f} s."
            )
            break
        last = place
        shown.append((round(place, 3), media_type, data))
    shown.sort(key=lambda one: one[0])  # stamps may jump back
    found.frames = [(place, media_type, len(data)) for place, media_type, data in shown]
    found.content = [data for *_, data in shown]
    if large:
        most = f"{_MOST_PIXELS / 1e6:.0f} million pixels"
        found.remarks.append(f"{topic} has images of more than {most}, which are skipped.")
    if damaged:
        found.remarks.append(f"{topic} has messages that are not images in JPEG, PNG or WebP.")
    return found


def _picture(decode: Decoder, message: RecordedMessage) -> tuple[bytes, tuple[str, int, int]]:
    """A message's picture, its media type, width and height.

    Raises:
        ValueError: it is none (also others of `UNDECODABLE`).
    """
    data = decode(message).data.tobytes()
    kind = size_of(data)
    if kind is None:
        raise ValueError("no picture")
    return data, kind

"""One part of a recorded drive, as it is shown."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from robovast.evaluation.drive.clock import Clock
from robovast.evaluation.drive.events import MOST_EVENTS, Changes, Event, log_events
from robovast.evaluation.drive.motion import (
    UNDECODABLE,
    Frames,
    Track,
    decoder,
    outline,
    path_points,
    scan_points,
    stamp_of,
    track_of,
    track_of_frames,
)
from robovast.evaluation.drive.recording import RecordedMessage, Recording
from robovast.evaluation.drive.roles import TRANSFORMS

_RATES = {"pose": 30.0, "scan": 12.0, "plan": 2.0, "footprint": 2.0}
"""How often something is shown, at most [1/s]."""
_AHEAD = 1_000_000_000
"""How far transforms are read beyond a part, to place its last poses [ns]."""
_INFO = 20

Points = list[list[float]]


@dataclass
class Part:
    """What happened in one part of a drive; times are places on the time line [s]."""

    times: list[float] = field(default_factory=list)
    x: list[float] = field(default_factory=list)
    """[m]"""
    y: list[float] = field(default_factory=list)
    yaw: list[float] = field(default_factory=list)
    """[rad]"""
    scans: list[tuple[float, list[int]]] = field(default_factory=list)
    """Time, and x, y, x, y, … of points seen from the robot [cm]."""
    plans: list[tuple[float, Points]] = field(default_factory=list)
    footprints: list[tuple[float, Points]] = field(default_factory=list)
    events: list[tuple[float, str, str, str, str]] = field(default_factory=list)
    """Time, kind, level or status, source, text."""
    remarks: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class DriveSource:
    """Where the parts of a drive are read from."""

    recording: Recording
    clock: Clock
    topics: Mapping[str, str]
    """Topics by role"""
    transforms: str
    """Topic of the transforms"""
    fixed: list[RecordedMessage]
    """Transforms that hold all the time."""

    def has_transforms(self, topic: str) -> bool:
        """Whether a topic has transforms."""
        known = self.recording.topics.get(topic)
        return known is not None and known.type == TRANSFORMS


class PartReader:
    """Reads one part."""

    def __init__(self, source: DriveSource, start: int, end: int) -> None:
        """Prepare reading the messages that were received from `start` to before `end` [ns]."""
        self._source = source
        self._recording = source.recording
        self._start, self._end = start, end
        self._part = Part()
        self._messages: dict[str, list[RecordedMessage]] = {}

    def read(self, *, scans: bool) -> Part:
        """The part, with what the laser saw or without."""
        self._collect(scans)
        frames = self._frames()
        self._add_poses(frames)
        self._add_scans(frames)
        self._add_shapes("plan", path_points, self._part.plans, frames)
        self._add_shapes("footprint", outline, self._part.footprints, frames)
        self._add_events()
        self._part.remarks += self._recording.all_faults()
        return self._part

    def _collect(self, scans: bool) -> None:
        """Read all messages of the part at once, no more of a topic than is shown."""
        left_out = {"map", "camera"} if scans else {"map", "camera", "scan"}
        roles = {topic: key for key, topic in self._source.topics.items() if key not in left_out}
        wanted = set(roles)
        if self._source.has_transforms(self._source.transforms):
            wanted.add(self._source.transforms)
        self._messages = {topic: [] for topic in wanted}
        last = dict.fromkeys(wanted, -math.inf)
        for message in self._recording.held(wanted, self._start, self._end + _AHEAD):
            topic = message.topic
            if topic != self._source.transforms:
                if message.time >= self._end:
                    continue
                if rate := _RATES.get(roles[topic]):
                    place = self._place(message)
                    if 0 <= place - last[topic] < 1 / rate:
                        continue
                    last[topic] = place
            self._messages[topic].append(message)

    def _place(self, message: RecordedMessage) -> float:
        return self._source.clock.at(message.time, stamp_of(message.data))

    def _frames(self) -> Frames:
        frames = Frames()
        topic = self._source.transforms
        frames.add(self._source.fixed)
        if topic in self._messages:
            frames.add(self._recording.before(topic, self._start))
            frames.add(self._messages[topic])
        self._damaged(topic, frames.damaged)
        if (episodes := len(frames.transforms.trees)) > 1:
            self._part.remarks.append(
                f"The stamps on {topic} jump back here, as after a simulation reset: this part "
                f"has {episodes} episodes."
            )
        return frames

    def _add_poses(self, frames: Frames) -> None:
        topic = self._source.topics.get("pose")
        if topic is None:
            return
        if self._source.has_transforms(topic):
            track = track_of_frames(frames, self._start, self._end)
        else:
            known = self._recording.topics[topic]
            track = track_of(known.type, self._messages[topic], decoder(known), frames)
            self._damaged(topic, track.damaged)
        if not track.placed:
            self._part.remarks.append(
                "No transform leads from the poses' frame to `map`; they are drawn as if both "
                "were the same."
            )
        self._add_track(track)

    def _add_track(self, track: Track) -> None:
        part, at = self._part, self._source.clock.at
        last = -math.inf
        for received, stamp, (x, y, yaw) in zip(
            track.received, track.stamps, track.poses.tolist(), strict=True
        ):
            place = at(received, stamp)
            if 0 <= place - last < 1 / _RATES["pose"]:
                continue
            last = place
            part.times.append(round(place, 3))
            part.x.append(round(x, 3))
            part.y.append(round(y, 3))
            part.yaw.append(round(yaw, 4))

    def _add_scans(self, frames: Frames) -> None:
        topic = self._source.topics.get("scan", "")
        messages = self._messages.get(topic, ())
        decode = decoder(self._recording.topics[topic]) if messages else None
        damaged, mounted = 0, True
        for message in messages:
            try:
                stamp = stamp_of(message.data) or message.time
                points, known = scan_points(decode and decode(message), frames, stamp, message.time)
            except UNDECODABLE:
                damaged += 1
                continue
            mounted = mounted and known
            self._part.scans.append((round(self._place(message), 3), points))
        self._damaged(topic, damaged)
        if not mounted:
            self._part.remarks.append(
                f"The position of the laser of {topic} on the robot is unknown, because no "
                "transform contains it. The laser is drawn in the middle of the robot."
            )

    def _add_shapes(
        self,
        role: str,
        read: Callable[[Any, Frames, int, int], Points],
        into: list[tuple[float, Points]],
        frames: Frames,
    ) -> None:
        """Add what a topic shows, and what it showed last before the part."""
        topic = self._source.topics.get(role)
        if topic is None:
            return
        decode = decoder(self._recording.topics[topic])
        damaged = 0
        for message in [*self._recording.before(topic, self._start)[-1:], *self._messages[topic]]:
            try:
                stamp = stamp_of(message.data) or message.time
                shape = read(decode(message), frames, stamp, message.time)
            except UNDECODABLE:
                damaged += 1
                continue
            into.append((round(self._place(message), 3), shape))
        self._damaged(topic, damaged)

    def _add_events(self) -> None:
        events: list[Event] = []
        if log := self._source.topics.get("log"):
            decode = decoder(self._recording.topics[log])
            events += log_events(self._messages[log], decode, _INFO)
        if tree := self._source.topics.get("tree"):
            known = self._recording.topics[tree]
            try:
                changes = Changes(known.type, decoder(known))
                before = self._recording.before(tree, self._start)[-1:]
                events += changes.events(before, self._messages[tree])
                self._damaged(tree, changes.damaged)
            except UNDECODABLE as error:
                self._part.remarks.append(f"The behavior tree of {tree} is not shown: {error}.")
        at = self._source.clock.at
        placed = (
            (round(at(e.received, e.stamp), 3), e.kind, e.level, e.source, e.text)
            for e in _most_important(events)
        )
        self._part.events = sorted(placed, key=lambda event: event[0])
        if len(events) > MOST_EVENTS:
            self._part.remarks.append(
                f"Only the {MOST_EVENTS} most important events are shown where there are more."
            )

    def _damaged(self, topic: str, count: int) -> None:
        if count:
            self._part.remarks.append(
                f"{topic} has messages that cannot be read as messages of its type."
            )


def _most_important(events: Iterable[Event]) -> list[Event]:
    order = {"fatal": 0, "error": 0, "warn": 1, "failure": 1}
    ranked = sorted(events, key=lambda event: order.get(event.level, 2))
    return ranked[:MOST_EVENTS]

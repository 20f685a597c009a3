"""Poses of the robot on the map, and what its laser sees."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from struct import Struct, error
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from robovast.analysis.bags.definitions import DefinitionError, typestore_of
from robovast.analysis.bags.source import Topic
from robovast.analysis.bags.transforms import Poses, Transforms, TransformTree, euler
from robovast.evaluation.drive.recording import RecordedMessage
from robovast.evaluation.drive.roles import ESTIMATE, FIXED, ODOMETRY

UNDECODABLE = (
    error,
    SerdeError,
    DefinitionError,
    ValueError,
    IndexError,
    KeyError,
    AttributeError,
    OverflowError,
    TypeError,
    RecursionError,
    MemoryError,
)
MOST_RAYS = 360
"""Rays of a scan that are shown."""
MOST_POINTS = 400
"""Points of a planned path that are shown."""
BASES = ("base_link", "base_footprint", "base")
"""Usual frames of a robot, the best first."""
_STAMP = {b"\0\1": Struct("<iI"), b"\0\0": Struct(">iI")}
_REFERENCE = "map"

Decoder = Callable[[RecordedMessage], Any]
Floats = NDArray[np.float64]
Moments = NDArray[np.int64]
Mount = tuple[Floats, Floats]
"""Position [m] and orientation of a sensor on the robot."""


def stamp_of(data: bytes) -> int | None:
    """The stamp [ns] at the beginning of a message that begins with one."""
    layout = _STAMP.get(data[:2])
    if layout is None or len(data) < 4 + layout.size:
        return None
    seconds, nanoseconds = layout.unpack_from(data, 4)
    return int(seconds) * 1_000_000_000 + int(nanoseconds)


@lru_cache(maxsize=1)
def _standard() -> Any:
    return get_typestore(Stores.ROS2_JAZZY)


def decoder(topic: Topic) -> Decoder:
    """A function that deserializes the messages of a topic.

    Types of ROS are taken as ROS defines them, whatever the bag says.
    """
    store = _standard()
    if topic.type not in store.types:
        store = typestore_of(topic.definition, None, "")
    return lambda message: store.deserialize_cdr(message.data, topic.type)


@dataclass
class Frames:
    """The transforms during one part of a drive."""

    transforms: Transforms = field(default_factory=Transforms)
    damaged: int = 0
    _mounts: dict[str, Mount | None] = field(default_factory=dict)

    def add(self, messages: Iterable[RecordedMessage]) -> None:
        """Add messages with transforms."""
        for message in messages:
            try:
                self.transforms.add(message.data, message.topic.endswith(FIXED), message.time)
            except UNDECODABLE:
                self.damaged += 1

    @cached_property
    def names(self) -> list[str]:
        """All frames; call this only after all messages have been added."""
        return self.transforms.frames

    @property
    def base(self) -> str:
        """The robot's frame."""
        return next((name for name in BASES if name in self.names), BASES[0])

    def ground(self, tree: TransformTree) -> str:
        """The frame that poses are shown in: the map, or the outermost that the robot is in."""
        return _REFERENCE if _REFERENCE in self.names else tree.root(self.base)

    def on_map(self, frame: str, stamps: Moments, received: Moments) -> Poses | None:
        """Poses of a frame on the map, the nearest known ones; None if there is no way."""
        if frame == _REFERENCE or frame not in self.names or _REFERENCE not in self.names:
            return None
        return self._in(frame, _REFERENCE, stamps, received)

    def _in(self, frame: str, reference: str, stamps: Moments, received: Moments) -> Poses | None:
        """Poses of a frame in another one, each in its episode; None if none is known."""
        count = len(stamps)
        found = Poses(np.zeros((count, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)), stamps < 0)
        episodes = self.transforms.episodes(stamps, received)
        for episode in np.unique(episodes).tolist():
            here, tree = episodes == episode, self.transforms.trees[episode]
            known, _ = tree.stamps(frame)
            times = np.clip(stamps[here], known[0], known[-1]) if len(known) else stamps[here]
            for all_, part in zip(found, tree.poses(frame, reference, times), strict=True):
                all_[here] = part
        return found if found.valid.any() else None

    def mount(self, frame: str, stamp: int, received: int) -> Mount | None:
        """Where a sensor is on the robot, during the whole part; None if it is not known."""
        if frame not in self._mounts:
            self._mounts[frame] = self._mount(frame.lstrip("/"), stamp, received)
        return self._mounts[frame]

    def _mount(self, frame: str, stamp: int, received: int) -> Mount | None:
        base = self.base
        if frame == base:
            return np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
        if frame not in self.names or base not in self.names:
            return None
        poses = self._in(frame, base, np.array([stamp]), np.array([received]))
        return (poses.position[0], poses.orientation[0]) if poses else None


@dataclass
class Track:
    """Poses of the robot on the map."""

    received: list[int] = field(default_factory=list)
    """Times of receipt [ns]"""
    stamps: list[int] = field(default_factory=list)
    """[ns]"""
    poses: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    """x, y [m], yaw [rad]"""
    placed: bool = True
    """False if nothing tells where the poses' frame lies on the map."""
    damaged: int = 0


def track_of(
    kind: str, messages: Sequence[RecordedMessage], decode: Decoder, frames: Frames
) -> Track:
    """The robot's poses, of messages of one of the types with a pose."""
    track = Track()
    rows: list[tuple[float, ...]] = []
    frame = ""
    for message in messages:
        try:
            content = decode(message)
            pose = content.pose.pose if kind in (ODOMETRY, ESTIMATE) else content.pose
            at, turn = pose.position, pose.orientation
            row = (at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w)
        except UNDECODABLE:
            track.damaged += 1
            continue
        if not (np.isfinite(row).all() and any(row[3:])):
            track.damaged += 1
            continue
        frame = str(content.header.frame_id).lstrip("/")
        track.received.append(message.time)
        track.stamps.append(stamp_of(message.data) or message.time)
        rows.append(row)
    if rows:
        _place(track, np.array(rows), frame, frames)
    return track


def _place(track: Track, rows: Floats, frame: str, frames: Frames) -> None:
    turned = rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    flat = np.column_stack((rows[:, :2], euler(turned)[:, 2]))
    stamps, received = (np.array(kind, np.int64) for kind in (track.stamps, track.received))
    way = frames.on_map(frame, stamps, received)
    if way is not None:
        yaw = euler(way.orientation)[:, 2]
        cos, sin = np.cos(yaw), np.sin(yaw)
        x, y = flat[:, 0].copy(), flat[:, 1].copy()
        flat[:, 0] = way.position[:, 0] + cos * x - sin * y
        flat[:, 1] = way.position[:, 1] + sin * x + cos * y
        flat[:, 2] += yaw
    track.poses = flat
    track.placed = way is not None or frame in ("", _REFERENCE)


def track_of_frames(frames: Frames, start: int, end: int) -> Track:
    """The robot's poses by transforms alone, received from `start` to before `end` [ns]."""
    track = Track()
    for tree in frames.transforms.trees:
        stamps, received = tree.stamps(frames.base)
        inside = (received >= start) & (received < end)
        if not inside.any():
            continue
        ground = frames.ground(tree)
        poses = tree.poses(frames.base, ground, stamps[inside])
        track.received += received[inside][poses.valid].tolist()
        track.stamps += stamps[inside][poses.valid].tolist()
        yaw = euler(poses.orientation[poses.valid])[:, 2]
        part = np.column_stack((poses.position[poses.valid][:, :2], yaw))
        track.poses = np.concatenate((track.poses, part))
        track.placed = track.placed and ground == _REFERENCE
    return track


def scan_points(scan: Any, frames: Frames, stamp: int, received: int) -> tuple[list[int], bool]:
    """Where a laser hits, seen from the robot: x, y, x, y, … [cm]; and whether its mount is known.

    Raises:
        ValueError: the scan is invalid (also others of `UNDECODABLE`).
    """
    ranges = np.asarray(scan.ranges, dtype=np.float64)
    step = max(1, -(-len(ranges) // MOST_RAYS))
    angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
    ranges, angles = ranges[::step], angles[::step]
    hit = np.isfinite(ranges) & (ranges >= scan.range_min) & (ranges <= scan.range_max)
    ranges, angles = ranges[hit], angles[hit]
    points = np.column_stack((ranges * np.cos(angles), ranges * np.sin(angles)))
    mount = frames.mount(str(scan.header.frame_id), stamp, received)
    if mount is not None:
        points = _turned(points, mount[1]) + mount[0][:2]
    if not np.isfinite(points).all():
        raise ValueError("its angles are not numbers")
    return np.clip(points * 100, -1e6, 1e6).round().astype(int).ravel().tolist(), mount is not None


def _turned(points: Floats, orientation: Floats) -> Floats:
    """Points of a sensor's plane, as seen from above the robot."""
    x, y, z, w = orientation
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z)],
        ]
    )
    turned: Floats = points @ turn.T
    return turned


def path_points(path: Any, frames: Frames, stamp: int, received: int) -> list[list[float]]:
    """Points of a planned path on the map [m]."""
    step = max(1, -(-len(path.poses) // MOST_POINTS))
    kept = [*path.poses[:-1:step], *path.poses[-1:]]
    points = ((p.pose.position.x, p.pose.position.y) for p in kept)
    return list(_on_map(points, path, frames, stamp, received))


def outline(polygon: Any, frames: Frames, stamp: int, received: int) -> list[list[float]]:
    """Corners of a footprint on the map [m]."""
    corners = polygon.polygon.points[:100]
    points = ((corner.x, corner.y) for corner in corners)
    return list(_on_map(points, polygon, frames, stamp, received))


def _on_map(
    points: Iterable[tuple[float, float]], message: Any, frames: Frames, stamp: int, received: int
) -> Iterator[list[float]]:
    frame = str(message.header.frame_id).lstrip("/")
    way = frames.on_map(frame, np.array([stamp], np.int64), np.array([received], np.int64))
    dx, dy, yaw = 0.0, 0.0, 0.0
    if way is not None:
        dx, dy = way.position[0, :2].tolist()
        yaw = float(euler(way.orientation)[0, 2])
    cos, sin = np.cos(yaw), np.sin(yaw)
    for x, y in points:
        if np.isfinite(x) and np.isfinite(y):
            yield [round(float(dx + cos * x - sin * y), 3), round(float(dy + sin * x + cos * y), 3)]

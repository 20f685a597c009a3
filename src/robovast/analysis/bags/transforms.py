"""The transform tree over the whole time of a bag.

Poses between two stamps are interpolated like in tf2: linearly in position, spherically in
orientation. Poses are never extrapolated.
"""

from __future__ import annotations

from array import array
from functools import cached_property
from struct import Struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Times = NDArray[np.int64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

_NORM_TOLERANCE = 1e-2
_SIZE = 56
"""Seven numbers in bytes: position x, y, z [m] and orientation x, y, z, w."""


_ORDERS = {b"\x00\x01": "<", b"\x00\x00": ">"}
_LENGTHS = {order: Struct(f"{order}I").unpack_from for order in "<>"}


class _Recorded(NamedTuple):
    """Serialized transforms, and their times of receipt [ns]."""

    transforms: bytearray
    received: array[int]


_Found = dict[str, dict[bytes, _Recorded]]
"""Transforms by byte order and serialized frame names."""


class Poses(NamedTuple):
    """Poses of a frame at n times."""

    position: Floats
    """(n, 3) [m]"""
    orientation: Floats
    """(n, 4) unit quaternions x, y, z, w."""
    valid: Mask
    """(n,) False where the pose is unknown."""


class _Samples(NamedTuple):
    """n transforms of a frame, in any order."""

    parents: list[str]
    times: Times
    """(n,) [ns]"""
    received: Times
    """(n,) times of receipt [ns]"""
    values: Floats
    """(n, 7) position [m] and orientation."""


class _Link:
    """A frame's pose in its parent over time; the parent may change."""

    def __init__(self, child: str, samples: _Samples, static: bool) -> None:
        times, values = samples.times, samples.values
        self.names = sorted(set(samples.parents))
        number = {name: index for index, name in enumerate(self.names)}
        parents = np.array([number[name] for name in samples.parents])
        usable = np.array([bool(name) and name != child for name in self.names])
        norms = np.sum(values[:, 3:] ** 2, axis=1)
        sound = np.isfinite(values).all(axis=1) & (np.abs(norms - 1) < _NORM_TOLERANCE)
        sound &= usable[parents]
        self.rejected = int((~sound).sum())
        self.static = static
        keep = _order(times, np.flatnonzero(sound), static)
        self.times = times[keep]
        self.received = samples.received[keep]
        self.parents: Indices = parents[keep]
        self.position: Floats = values[keep, :3]
        self.orientation: Floats = values[keep, 3:]

    def at(self, times: Times) -> tuple[Indices, Poses]:
        """Index of the parent, and pose in it, at each of n times."""
        last = len(self.times) - 1
        if self.static:
            before = after = np.zeros(len(times), dtype=np.int64)
            valid = np.ones(len(times), dtype=bool)
        else:
            before = np.searchsorted(self.times, times, side="right") - 1
            valid = (before >= 0) & (times <= self.times[last])
            before = np.clip(before, 0, last)
            after = np.minimum(before + 1, last)
        after = np.where(self.parents[after] == self.parents[before], after, before)
        span = self.times[after] - self.times[before]
        share = np.where(span > 0, (times - self.times[before]) / np.maximum(span, 1), 0.0)
        start, end = self.position[before], self.position[after]
        position = start + share[:, None] * (end - start)
        orientation = slerp(self.orientation[before], self.orientation[after], share)
        return self.parents[before], Poses(position, orientation, valid)


def _frame(name: bytes) -> str:
    return name.decode("utf-8", "backslashreplace").lstrip("/")


def _order(times: Times, sound: Indices, static: bool) -> Indices:
    """Indexes of valid samples by time: the last static one, the first of equal stamps."""
    if static:
        return sound[np.argsort(times[sound], kind="stable")][-1:]
    _, first = np.unique(times[sound], return_index=True)
    kept: Indices = sound[first]
    return kept


class TransformTree:
    """All transforms of a recording."""

    def __init__(self) -> None:
        self._moving: _Found = {"<": {}, ">": {}}
        self._fixed: _Found = {"<": {}, ">": {}}

    def add(self, data: bytes, static: bool, received: int) -> None:
        """Add a serialized tf2_msgs/msg/TFMessage.

        Args:
            data: the message.
            static: its transforms are valid at all times.
            received: time of receipt [ns].

        Raises:
            ValueError: the message is invalid (also struct.error).
        """
        order = _ORDERS.get(data[:2])
        if order is None:
            raise ValueError("unknown encapsulation")
        length = _LENGTHS[order]
        found = (self._fixed if static else self._moving)[order]
        message = data[4:]
        (count,) = length(message, 0)
        offset = 4
        for _ in range(count):
            (size,) = length(message, offset + 8)
            child = (offset + size + 15) & -4
            (size,) = length(message, child)
            values = (child + size + 11) & -8
            if values + _SIZE > len(message):
                raise ValueError("it is too short")
            names = message[offset + 8 : values]
            transform = message[offset : values + _SIZE]
            try:
                recorded = found[names]
            except KeyError:
                recorded = found[names] = _Recorded(bytearray(), array("q"))
            recorded.transforms.extend(transform)
            recorded.received.append(received)
            offset = values + _SIZE

    @cached_property
    def _links(self) -> dict[str, _Link]:
        """Links by frame; call this only after all transforms have been added."""
        return {
            child: _Link(child, samples, static)
            for found, static in ((self._fixed, True), (self._moving, False))
            for child, samples in _samples(found).items()
        }

    @property
    def rejected(self) -> int:
        """Number of transforms not finite, not normalized, without parent or to themselves."""
        return sum(link.rejected for link in self._links.values())

    @cached_property
    def _sound(self) -> dict[str, _Link]:
        return {child: link for child, link in self._links.items() if child and len(link.times)}

    @property
    def frames(self) -> list[str]:
        """All frames, sorted."""
        parents = {name for link in self._sound.values() for name in link.names}
        return sorted(parents | set(self._sound))

    def root(self, frame: str) -> str:
        """The outermost frame above a frame at the end of the recording."""
        seen: set[str] = set()
        while frame in self._sound and frame not in seen:
            seen.add(frame)
            link = self._sound[frame]
            frame = link.names[link.parents[-1]]
        return frame

    def stamps(self, frame: str) -> tuple[Times, Times]:
        """Stamps of a frame, or of what it is fixed to, and their times of receipt [ns]."""
        seen: set[str] = set()
        while frame in self._sound and frame not in seen:
            seen.add(frame)
            link = self._sound[frame]
            parent = link.names[link.parents[-1]]
            if not link.static or parent not in self._sound:
                return link.times, link.received
            frame = parent
        nothing = np.zeros(0, dtype=np.int64)
        return nothing, nothing

    def poses(self, frame: str, reference: str, times: Times) -> Poses:
        """Poses of a frame in a reference frame at n times [ns].

        Args:
            frame: the frame.
            reference: the reference frame.
            times: (n,) [ns].
        """
        roots, poses = self._climb(frame, reference, times, frozenset())
        elsewhere = roots != reference
        if not elsewhere.any():
            return poses
        common, origin = self._climb(reference, "", times, frozenset())
        relative = _compose(_inverse(origin), poses)
        valid = relative.valid & (common == roots)
        return Poses(
            np.where(elsewhere[:, None], relative.position, poses.position),
            np.where(elsewhere[:, None], relative.orientation, poses.orientation),
            np.where(elsewhere, valid, poses.valid),
        )

    def _climb(
        self, frame: str, stop: str, times: Times, seen: frozenset[str]
    ) -> tuple[NDArray[np.object_], Poses]:
        """Walk up the tree to `stop` or a root; return that frame's name and the pose in it."""
        count = len(times)
        ends = np.full(count, frame, dtype=object)
        if frame == stop or frame not in self._sound:
            identity = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
            return ends, Poses(np.zeros((count, 3)), identity, np.ones(count, dtype=bool))
        link = self._sound[frame]
        parents, poses = link.at(times)
        if frame in seen:  # a cycle
            return ends, poses._replace(valid=np.zeros(count, dtype=bool))
        position, orientation = poses.position.copy(), poses.orientation.copy()
        valid = poses.valid.copy()
        for parent in np.unique(parents):
            here = parents == parent
            above, way = self._climb(link.names[parent], stop, times[here], seen | {frame})
            inner = Poses(poses.position[here], poses.orientation[here], poses.valid[here])
            ends[here] = above
            position[here], orientation[here], valid[here] = _compose(way, inner)
        return ends, Poses(position, orientation, valid)


def _samples(found: _Found) -> dict[str, _Samples]:
    """Transforms by child frame."""
    samples: dict[str, _Samples] = {}
    groups = ((order, *item) for order, group in found.items() for item in group.items())
    for order, names, (transforms, received) in groups:
        parent, child = _names(order, names)
        raw = np.frombuffer(transforms, np.uint8).reshape(-1, 8 + len(names) + _SIZE)
        stamps = np.ascontiguousarray(raw[:, :8]).view(f"{order}i4").astype(np.int64)
        stamps[:, 1] &= 0xFFFFFFFF  # nanoseconds are unsigned
        values = np.ascontiguousarray(raw[:, -_SIZE:]).view(f"{order}f8").astype(np.float64)
        times = stamps @ np.array([1_000_000_000, 1])
        new = _Samples([parent] * len(values), times, np.array(received, dtype=np.int64), values)
        old = samples.get(child)
        samples[child] = _joined(old, new) if old else new
    return samples


def _names(order: str, names: bytes) -> tuple[str, str]:
    """Names of parent and child."""
    length = _LENGTHS[order]
    (size,) = length(names, 0)
    start = (size + 7) & -4
    (child_size,) = length(names, start)
    return _frame(names[4 : 3 + size]), _frame(names[start + 4 : start + 3 + child_size])


def _joined(one: _Samples, other: _Samples) -> _Samples:
    return _Samples(
        one.parents + other.parents,
        np.concatenate((one.times, other.times)),
        np.concatenate((one.received, other.received)),
        np.concatenate((one.values, other.values)),
    )


def slerp(start: Floats, end: Floats, share: Floats) -> Floats:
    """Interpolate orientations on the shorter arc.

    Args:
        start: (n, 4) quaternions x, y, z, w.
        end: (n, 4) quaternions x, y, z, w.
        share: (n,) position on the arc, from 0 to 1.

    Returns:
        (n, 4) unit quaternions.
    """
    cosine = np.sum(start * end, axis=1)
    end = np.where(cosine[:, None] < 0, -end, end)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    sine = np.sin(angle)
    near = sine < 1e-6
    divisor = np.where(near, 1.0, sine)
    first = np.where(near, 1 - share, np.sin((1 - share) * angle) / divisor)
    second = np.where(near, share, np.sin(share * angle) / divisor)
    mixed: Floats = first[:, None] * start + second[:, None] * end
    mixed /= np.linalg.norm(mixed, axis=1, keepdims=True)
    return mixed


def euler(orientation: Floats) -> Floats:
    """Roll, pitch and yaw [rad] of (n, 4) quaternions x, y, z, w about fixed axes: (n, 3)."""
    x, y, z, w = orientation.T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    sine = np.clip(2 * (w * y - z * x), -1.0, 1.0)
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    upright = np.abs(sine) > 1 - 1e-12  # gimbal lock: everything counts as yaw
    yaw = np.where(upright, -np.sign(sine) * 2 * np.arctan2(x, w), yaw)
    angles: Floats = np.column_stack((np.where(upright, 0.0, roll), np.arcsin(sine), yaw))
    return angles


def _compose(outer: Poses, inner: Poses) -> Poses:
    return Poses(
        outer.position + _rotate(outer.orientation, inner.position),
        _multiply(outer.orientation, inner.orientation),
        outer.valid & inner.valid,
    )


def _inverse(poses: Poses) -> Poses:
    back = poses.orientation * [-1.0, -1.0, -1.0, 1.0]
    return Poses(-_rotate(back, poses.position), back, poses.valid)


def _multiply(left: Floats, right: Floats) -> Floats:
    vector = (
        left[:, 3:] * right[:, :3]
        + right[:, 3:] * left[:, :3]
        + np.cross(left[:, :3], right[:, :3])
    )
    scalar = left[:, 3] * right[:, 3] - np.sum(left[:, :3] * right[:, :3], axis=1)
    product: Floats = np.column_stack((vector, scalar))
    return product


def _rotate(orientation: Floats, vectors: Floats) -> Floats:
    axis = orientation[:, :3]
    turned = 2 * np.cross(axis, vectors)
    rotated: Floats = vectors + orientation[:, 3:] * turned + np.cross(axis, turned)
    return rotated

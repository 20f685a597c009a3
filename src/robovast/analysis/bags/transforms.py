"""The transform trees of a bag: one for each episode.

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

from robovast.analysis.episodes import Times, episode_starts
from robovast.base.errors import InputError

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

_NORM_TOLERANCE = 1e-2
_SAME = 1_000_000_000
"""Time of receipt within which jumps of several frames belong to one jump [ns]."""
_MOST_FRAMES = 500
"""Most frames between a frame and its reference; tf2 follows at most 1000."""
_MOST_LINKS = 1 << 18
"""Most episodes times frames; a robot has some 100 frames, and resets are rare."""
_MOST_COMPARED = 1 << 32
"""Most transforms times resets, which takes about a minute."""
_SIZE = 56
"""Seven numbers in bytes: position x, y, z [m] and orientation x, y, z, w."""


_ORDERS = {b"\x00\x01": "<", b"\x00\x00": ">"}
_LENGTHS = {order: Struct(f"{order}I").unpack_from for order in "<>"}


class _Recorded(NamedTuple):
    """Serialized transforms, and the numbers of their messages."""

    transforms: bytearray
    messages: array[int]


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
    """n valid transforms of a frame in order of receipt."""

    names: list[str]
    """Names of the parents."""
    parents: Indices
    """(n,) indexes of names."""
    times: Times
    """(n,) stamps [ns]"""
    received: Times
    """(n,) times of receipt [ns]"""
    places: Times
    """(n,) places in the order of receipt of all messages."""
    values: Floats
    """(n, 7) position [m] and orientation."""

    def part(self, kept: Indices) -> _Samples:
        """Return the transforms at some indexes."""
        return _Samples(
            self.names,
            self.parents[kept],
            self.times[kept],
            self.received[kept],
            self.places[kept],
            self.values[kept],
        )

    def moment(self, index: int) -> _Moment:
        """Return the moment of one transform."""
        return _Moment(int(self.places[index]), int(self.received[index]), int(self.times[index]))


class _Link:
    """A frame's pose in its parent during an episode; the parent may change."""

    def __init__(self, samples: _Samples, static: bool) -> None:
        if not static:  # the first transform of those with equal stamps counts
            samples = samples.part(np.unique(samples.times, return_index=True)[1])
        self.static = static
        self.names, self.parents, self.times, self.received, _, values = samples
        self.position: Floats = values[:, :3]
        self.orientation: Floats = values[:, 3:]

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


class _Moment(NamedTuple):
    """When a transform was received and what it states."""

    place: int
    received: int
    """[ns]"""
    stamp: int
    """[ns]"""


class _Jump(NamedTuple):
    """A jump back in time: the end of an episode and the start of the next."""

    old: _Moment
    """The last transform before the jump of the first frame that jumps."""
    new: _Moment
    """The next transform of that frame."""
    starts: dict[str, int]
    """Index of the first transform after the jump, of each frame whose own stamps jump."""

    def precedes(self, order: Times, stamps: Times, old: int, new: int) -> Mask:
        """Whether the jump precedes messages; messages between both ends belong to the nearer one.

        Args:
            order: (n,) places or times of receipt.
            stamps: (n,) [ns].
            old: place or time of receipt of the old end.
            new: place or time of receipt of the new end.
        """
        nearer = stamps - self.new.stamp <= self.old.stamp - stamps
        later: Mask = (order > new) | ((order >= old) & nearer)
        return later


class Transforms:
    """All transforms of a recording.

    A jump back in time of a frame's stamps begins a new episode for all frames. As in tf2, moving
    transforms hold in their own episode only, and fixed transforms survive.
    """

    def __init__(self) -> None:
        self._moving: _Found = {"<": {}, ">": {}}
        self._fixed: _Found = {"<": {}, ">": {}}
        self._received = array("q")

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
        number = len(self._received)
        self._received.append(received)
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
            recorded.messages.append(number)
            offset = values + _SIZE

    @cached_property
    def _samples(self) -> list[dict[str, _Samples]]:
        """Moving and fixed transforms by frame; call this only after all have been added."""
        received = np.array(self._received, dtype=np.int64)
        places = np.empty_like(received)
        places[np.argsort(received, kind="stable")] = np.arange(len(received))
        return [_samples(found, received, places) for found in (self._moving, self._fixed)]

    @property
    def rejected(self) -> int:
        """Number of transforms not finite, not normalized, without parent or to themselves."""
        groups = (group for found in (self._moving, self._fixed) for group in found.values())
        recorded = sum(len(one.messages) for group in groups for one in group.values())
        return recorded - sum(len(s.times) for found in self._samples for s in found.values())

    @cached_property
    def _jumps(self) -> list[_Jump]:
        moving = self._samples[0]
        starts = [
            (int(samples.places[index]), frame, index)
            for frame, samples in moving.items()
            for index in episode_starts(samples.times, samples.received)
        ]
        jumps: list[_Jump] = []
        for _, frame, index in sorted(starts):
            old, new = moving[frame].moment(index - 1), moving[frame].moment(index)
            last = jumps[-1] if jumps else None
            same = last and (
                old.place <= last.new.place or new.received - last.new.received <= _SAME
            )
            if last and same and frame not in last.starts:
                last.starts[frame] = index
            else:
                jumps.append(_Jump(old, new, {frame: index}))
        return jumps

    def episodes(self, stamps: Times, received: Times) -> Indices:
        """Return the index of the tree of each of n other messages.

        Args:
            stamps: (n,) [ns].
            received: (n,) times of receipt [ns].
        """
        numbers = np.zeros(len(stamps), dtype=np.int64)
        for jump in self._jumps:
            numbers += jump.precedes(received, stamps, jump.old.received, jump.new.received)
        return numbers

    def _episodes(self, frame: str, samples: _Samples, static: bool) -> Indices:
        """Return the index of the tree of each of a frame's own transforms."""
        numbers = np.zeros(len(samples.times), dtype=np.int64)
        for jump in self._jumps:
            start = None if static else jump.starts.get(frame)
            if start is None:
                numbers += jump.precedes(
                    samples.places, samples.times, jump.old.place, jump.new.place
                )
            else:
                numbers[start:] += 1
        return numbers

    @cached_property
    def trees(self) -> list[TransformTree]:
        """The tree of each episode; there is at least one.

        Raises:
            InputError: there are more than memory and time allow.
        """
        moving, fixed = self._samples
        jumps, frames = len(self._jumps), len(moving) + len(fixed)
        transforms = sum(len(s.times) for found in self._samples for s in found.values())
        if jumps and (jumps * frames > _MOST_LINKS or jumps * transforms > _MOST_COMPARED):
            raise InputError(
                f"the stamps of its transforms jump back {jumps} times, which is too often for "
                f"{frames} frames and {transforms:,} transforms.",
                hint="record the bag again with a steady clock",
            )
        links: list[dict[str, _Link]] = [{} for _ in range(jumps + 1)]
        for frame, samples in fixed.items():
            numbers = self._episodes(frame, samples, static=True)
            for episode, tree in enumerate(links):
                last = np.flatnonzero(numbers <= episode)[-1:]
                tree[frame] = _Link(samples.part(last if len(last) else np.array([0])), True)
        for frame, samples in moving.items():
            numbers = self._episodes(frame, samples, static=False)
            for episode in np.unique(numbers).tolist():
                links[episode][frame] = _Link(
                    samples.part(np.flatnonzero(numbers == episode)), False
                )
        return [TransformTree(tree) for tree in links]

    @property
    def frames(self) -> list[str]:
        """All frames, sorted."""
        return sorted({frame for tree in self.trees for frame in tree.frames})


class TransformTree:
    """All transforms of one episode."""

    def __init__(self, links: dict[str, _Link]) -> None:
        self._links = links

    @cached_property
    def frames(self) -> list[str]:
        """All frames, sorted."""
        parents = {
            link.names[one] for link in self._links.values() for one in np.unique(link.parents)
        }
        return sorted(parents | set(self._links))

    def root(self, frame: str) -> str:
        """The outermost frame above a frame at the end of the episode."""
        seen: set[str] = set()
        while frame in self._links and frame not in seen:
            seen.add(frame)
            link = self._links[frame]
            frame = link.names[link.parents[-1]]
        return frame

    def stamps(self, frame: str) -> tuple[Times, Times]:
        """Stamps of a frame, or of what it is fixed to, and their times of receipt [ns]."""
        seen: set[str] = set()
        while frame in self._links and frame not in seen:
            seen.add(frame)
            link = self._links[frame]
            parent = link.names[link.parents[-1]]
            if not link.static or parent not in self._links:
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
        if frame == stop or frame not in self._links:
            identity = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
            return ends, Poses(np.zeros((count, 3)), identity, np.ones(count, dtype=bool))
        link = self._links[frame]
        parents, poses = link.at(times)
        if frame in seen or len(seen) > _MOST_FRAMES:  # a cycle, or one in effect
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


def _samples(found: _Found, received: Times, places: Times) -> dict[str, _Samples]:
    """Valid transforms by child frame, given each message's time of receipt and place."""
    parts: dict[str, list[tuple[str, Times, Times, Floats]]] = {}
    groups = ((order, *item) for order, group in found.items() for item in group.items())
    for order, names, (transforms, messages) in groups:
        parent, child = _names(order, names)
        raw = np.frombuffer(transforms, np.uint8).reshape(-1, 8 + len(names) + _SIZE)
        stamps = np.ascontiguousarray(raw[:, :8]).view(f"{order}i4").astype(np.int64)
        stamps[:, 1] &= 0xFFFFFFFF  # nanoseconds are unsigned
        times = stamps @ np.array([1_000_000_000, 1])
        values = np.ascontiguousarray(raw[:, -_SIZE:]).view(f"{order}f8").astype(np.float64)
        with np.errstate(over="ignore"):  # a norm of infinity is as wrong as any other
            norms = np.sum(values[:, 3:] ** 2, axis=1)
        valid = np.isfinite(values).all(axis=1) & (np.abs(norms - 1) < _NORM_TOLERANCE)
        if valid.any() and parent and child and parent != child:
            numbers = np.array(messages, dtype=np.int64)[valid]
            parts.setdefault(child, []).append((parent, times[valid], numbers, values[valid]))
    return {child: _joined(several, received, places) for child, several in parts.items()}


def _joined(
    parts: list[tuple[str, Times, Times, Floats]], received: Times, places: Times
) -> _Samples:
    """Transforms of a frame with several parents, in order of receipt."""
    names = sorted({parent for parent, *_ in parts})
    parents = np.repeat([names.index(parent) for parent, *_ in parts], [len(p[1]) for p in parts])
    times, numbers, values = (np.concatenate(kind) for kind in list(zip(*parts, strict=True))[1:])
    samples = _Samples(names, parents, times, received[numbers], places[numbers], values)
    return samples.part(np.argsort(samples.places, kind="stable"))


def _names(order: str, names: bytes) -> tuple[str, str]:
    """Names of parent and child."""
    length = _LENGTHS[order]
    (size,) = length(names, 0)
    start = (size + 7) & -4
    (child_size,) = length(names, start)
    return _frame(names[4 : 3 + size]), _frame(names[start + 4 : start + 3 + child_size])


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

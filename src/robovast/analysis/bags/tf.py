"""Writes poses of frames in `map` to a CSV file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from robovast.analysis.bags.flatten import number_text, seconds_cell, text_cell
from robovast.analysis.bags.job import Context, nothing_on
from robovast.analysis.bags.source import Consumer, Topic
from robovast.analysis.bags.table import written
from robovast.analysis.bags.transforms import TransformTree, euler
from robovast.model.document.commands import TfToCsv

REFERENCE = "map"
_TYPE = "tf2_msgs/msg/TFMessage"
_STATIC = {"/tf": False, "/tf_static": True}
_COLUMNS = (
    "frame",
    "timestamp",
    "position.x",
    "position.y",
    "position.z",
    "orientation.roll",
    "orientation.pitch",
    "orientation.yaw",
)


class TfWorker:
    """Writes each frame's pose [m, rad] in `map` at each stamp, with the time of receipt [s]."""

    def __init__(self, context: Context, job: TfToCsv) -> None:
        self._context = context
        self._frames = tuple(dict.fromkeys(frame.lstrip("/") for frame in job.frames))
        self._table = context.table(job.csv_filename, _COLUMNS)
        self._tree = TransformTree()

    def subscribe(self, topic: Topic) -> Consumer | None:
        """The consumer of a topic of transforms, or None."""
        static = _STATIC.get(topic.name)
        if static is None or topic.type != _TYPE:
            return None
        add = self._tree.add
        return lambda time, data: add(data, static, time)

    def finish(self) -> list[Path]:
        """The table; empty if no pose is known."""
        if self._tree.frames:
            self._write()
        else:
            self._context.warn(nothing_on(self._context, "/tf"))
        if self._tree.rejected:
            self._context.warn(
                f"{self._tree.rejected} transforms are left out: they are not finite, not "
                "normalized, lack a frame name, or have one frame as parent and child"
            )
        return written(self._table)

    def discard(self) -> None:
        """Remove unfinished files."""
        self._table.discard()

    def _write(self) -> None:
        rows: list[tuple[int, int, bytes]] = []
        for number, frame in enumerate(self._frames):
            rows += ((time, number, line) for time, line in self._lines(frame))
        rows.sort(key=lambda row: row[:2])
        if rows:
            self._table.add_lines(line for _, _, line in rows)

    def _lines(self, frame: str) -> Iterator[tuple[int, bytes]]:
        times, received = self._tree.stamps(frame)
        poses = self._tree.poses(frame, REFERENCE, times)
        self._say_what_is_missing(frame, len(times), int(poses.valid.sum()))
        values = np.column_stack((poses.position, euler(poses.orientation)))[poses.valid]
        name = text_cell(frame.encode())
        for time, row in zip(received[poses.valid].tolist(), values.tolist(), strict=True):
            yield time, b"%b,%b,%b" % (name, seconds_cell(time), number_text(row))

    def _say_what_is_missing(self, frame: str, stamps: int, known: int) -> None:
        name, frames = self._context.bag.name, self._tree.frames
        if frame not in frames or REFERENCE not in frames:
            unknown = frame if frame not in frames else REFERENCE
            self._context.warn(f"{name} has no frame {unknown}; it has {', '.join(frames)}")
        elif known < stamps:
            self._context.warn(
                f"{stamps - known} of {stamps} poses of {frame} in {REFERENCE} are left out: "
                "the transforms between them do not cover these times"
            )

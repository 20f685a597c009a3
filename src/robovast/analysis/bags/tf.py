"""Writes poses of frames in a root frame to a CSV file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from robovast.analysis.bags.flatten import number_text, seconds_cell, text_cell
from robovast.analysis.bags.job import Context, nothing_on
from robovast.analysis.bags.source import Consumer, Topic
from robovast.analysis.bags.table import written
from robovast.analysis.bags.transforms import Transforms, TransformTree, euler
from robovast.model.document.commands import TfToCsv

_TYPE = "tf2_msgs/msg/TFMessage"
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


def _cells(columns: tuple[str, ...]) -> list[list[str]]:
    """Columns of each cell after the leading ones: one each."""
    return [[column] for column in columns]


class TfWorker:
    """Writes each frame's pose [m, rad] in a root frame at each stamp, with time of receipt [s]."""

    def __init__(self, context: Context, job: TfToCsv) -> None:
        self._context = context
        self._frames = tuple(dict.fromkeys(frame.lstrip("/") for frame in job.frames))
        self._root = job.root_frame.lstrip("/")
        self._topic = f"/{job.tf_topic.strip('/')}"
        self._table = context.table(job.csv_filename, _COLUMNS, _cells)
        self._transforms = Transforms()

    def subscribe(self, topic: Topic) -> Consumer | None:
        """The consumer of a topic of transforms, or None."""
        if topic.type != _TYPE or topic.name not in (self._topic, f"{self._topic}_static"):
            return None
        add, static = self._transforms.add, topic.name != self._topic
        return lambda time, data: add(data, static, time)

    def finish(self) -> list[Path]:
        """The table; empty if no pose is known."""
        trees, frames = self._transforms.trees, self._transforms.frames
        rows = [row for number in range(len(self._frames)) for row in self._rows(number, trees)]
        rows.sort(key=lambda row: row[:3])
        episodes = len(trees) > 1
        if rows:
            self._table.add_lines((line for *_, line in rows), ("episode",) if episodes else ())
        if episodes:
            self._context.warn(
                f"{self._context.bag.name} has {len(trees)} episodes: the stamps on {self._topic} "
                f"jump back, as after a simulation reset. The column `episode` of "
                f"{self._table.path.name} numbers the episodes"
            )
        if not frames:
            self._context.warn(self._nothing())
        if self._transforms.rejected:
            self._context.warn(
                f"{self._transforms.rejected} transforms are skipped. Causes: not finite, not "
                "normalized, no frame name, or the same parent and child frame"
            )
        return written(self._table)

    def discard(self) -> None:
        """Remove unfinished files."""
        self._table.discard()

    def _rows(
        self, number: int, trees: list[TransformTree]
    ) -> Iterator[tuple[int, int, int, bytes]]:
        """Yield episode, time of receipt [ns], frame number and line of each pose of a frame."""
        frame, stamps, known = self._frames[number], 0, 0
        name = text_cell(frame.encode())
        for episode, tree in enumerate(trees, 1):
            times, received = tree.stamps(frame)
            poses = tree.poses(frame, self._root, times)
            values = np.column_stack((poses.position, euler(poses.orientation)))[poses.valid]
            stamps, known = stamps + len(times), known + len(values)
            end = b",%d" % episode if len(trees) > 1 else b""
            for time, row in zip(received[poses.valid].tolist(), values.tolist(), strict=True):
                line = b"%b,%b,%b%b" % (name, seconds_cell(time), number_text(row), end)
                yield episode, time, number, line
        self._report_missing(frame, stamps, known)

    def _report_missing(self, frame: str, stamps: int, known: int) -> None:
        name, frames = self._context.bag.name, self._transforms.frames
        unknown = next((one for one in (frame, self._root) if one not in frames), None)
        if frames and unknown is not None:
            parameter = "frames" if unknown == frame else "root_frame"
            self._context.warn(
                f"{name} has no frame {unknown}; it has {', '.join(frames)}. "
                f"Set `{parameter}` to one of them"
            )
        elif known < stamps:
            self._context.warn(
                f"{stamps - known} of {stamps} poses of {frame} in {self._root} are skipped: the "
                "transforms between them do not cover these times"
            )

    def _nothing(self) -> str:
        """Return the warning that there are no transforms, with the topics that have some."""
        topics = self._context.topics
        others = sorted(
            name for name in topics if topics[name] == _TYPE and not name.endswith("_static")
        )
        if not others or self._topic in topics:
            return nothing_on(self._context, self._topic)
        return (
            f"{self._context.bag.name} has no transform on {self._topic}; it has transforms on "
            f"{', '.join(others)}. Set `tf_topic` to one of them"
        )

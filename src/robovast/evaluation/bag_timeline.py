"""Counts a ROS bag's messages by topic and time.

Only indexes are read and no message is decompressed: a bag of gigabytes takes a second.
"""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

from robovast.base.bounds import Bound
from robovast.base.errors import InputError
from robovast.evaluation.confined_files import MissingError, resolved
from robovast.evaluation.drive.recording import open_files
from robovast.evaluation.run import Timeline

BINS = 150
"""Number of intervals into which a bag's time is divided."""

_TICK = 50_000_000
"""Resolution [ns]"""
Ticks = Counter[tuple[str, int]]
"""Messages by topic and tick."""


def read_timeline(root: Path, relative: str) -> Timeline:
    """The timeline of a bag.

    Raises:
        InputError: there is no such folder below `root`, or its files cannot be read.
    """
    folder = resolved(root, relative)
    if not os.path.isdir(folder):
        raise MissingError(f"{relative} is not a folder.")
    ticks: Ticks = Counter()
    bound = Bound()
    files = list(open_files(root, relative))
    for file in files:
        for block in file.blocks:
            if bound.late() or not file.complete:
                raise InputError(
                    f"{relative} has too many records to be counted for a timeline",
                    hint="convert it with `vast results postprocess`, or record fewer topics",
                )
            found = Counter((channel, time // _TICK) for channel, time in file.times(block))
            for (channel, tick), count in found.items():
                if channel in file.topics:
                    ticks[file.topics[channel].name, tick] += count
    if files and not ticks and (faults := [fault for file in files for fault in file.faults]):
        raise InputError(". ".join(faults))
    return _binned(ticks)


def _binned(ticks: Ticks) -> Timeline:
    if not ticks:
        return Timeline(0, 0, {})
    first = min(tick for _, tick in ticks)
    length = max(tick for _, tick in ticks) - first + 1
    topics: dict[str, list[int]] = {}
    for (topic, tick), count in ticks.items():
        topics.setdefault(topic, [0] * BINS)[(tick - first) * BINS // length] += count
    scale = _TICK / 1e9
    return Timeline(first * scale, (first + length) * scale, dict(sorted(topics.items())))

"""Termination messages: what the operator reads of a container that has ended."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robovast.base.ranges import format_ranges, spans, truncate
from robovast.campaign.verdict import Verdict

LIMIT = 4096
"""Longest message that Kubernetes keeps [byte]."""
RANGES_LIMIT = 800
"""Longest text of one kind of runs [byte]."""
ERROR_LIMIT = 1500
"""[byte]"""


def verdict_ranges(verdicts: Mapping[int, Verdict]) -> dict[str, Any]:
    """`{"passed": "0-3", "failed": "4", "errored": "", "counts": [4, 1, 0]}`, ids of runs.

    Ids that there is no room for are missing, and `truncated` is set; the counts are always exact.
    """
    kinds = (Verdict.PASSED, Verdict.FAILED, Verdict.ERRORED)
    ids = [[id_ for id_, found in verdicts.items() if found is kind] for kind in kinds]
    cut = [truncate(format_ranges(spans(some)), RANGES_LIMIT) for some in ids]
    message: dict[str, Any] = {str(kind): text for kind, (text, _) in zip(kinds, cut, strict=True)}
    message["counts"] = [len(some) for some in ids]
    return message | ({"truncated": True} if any(was_cut for _, was_cut in cut) else {})


def write_message(path: Path, message: Mapping[str, Any]) -> None:
    """Leave a termination message, when the container has one.

    Args:
        path: of the message; Kubernetes makes the file.
        message: what it says.
    """
    if path.exists():
        _rewrite(path, json.dumps(message))


def _rewrite(path: Path, text: str) -> None:
    """Replace what a file says without giving its room away first: the disk may be full."""
    with path.open("r+b") as file:
        file.write(text.encode())
        file.truncate()


def write_error(path: Path, error: str, *, as_json: bool) -> None:
    """Leave what went wrong as termination message.

    Args:
        path: of the message.
        error: what went wrong.
        as_json: as the key `error` beside what the message says already.
    """
    if not path.exists():
        return
    said = path.read_text(encoding="utf-8")
    text = _shortened(error, ERROR_LIMIT)
    if as_json:
        write_message(path, {**json.loads(said or "{}"), "error": text})
    else:
        _rewrite(path, text)


def _shortened(text: str, limit: int) -> str:
    """A text that takes no more than so many bytes in JSON."""
    while len(json.dumps(text)) > limit:
        text = text[: len(text) * 3 // 4] + "…"
    return text

"""Termination messages: what the operator reads of a container that has ended."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robovast.cluster.ranges import format_ranges, spans, truncate
from robovast.results.verdict import Verdict

LIMIT = 4096
"""Longest message that Kubernetes keeps [byte]."""
RANGES_LIMIT = 1200
"""Longest text of one kind of runs."""
ERROR_LIMIT = 1500


def verdict_ranges(verdicts: Mapping[int, Verdict]) -> dict[str, Any]:
    """`{"passed": "0-3", "failed": "4", "errored": ""}`, ids of runs."""
    kinds = (Verdict.PASSED, Verdict.FAILED, Verdict.ERRORED)
    texts = {
        str(kind): format_ranges(spans(id_ for id_, found in verdicts.items() if found is kind))
        for kind in kinds
    }
    cut = {kind: truncate(text, RANGES_LIMIT) for kind, text in texts.items()}
    message: dict[str, Any] = {kind: text for kind, (text, _) in cut.items()}
    return message | ({"truncated": True} if any(was_cut for _, was_cut in cut.values()) else {})


def write_message(path: Path, message: Mapping[str, Any]) -> None:
    """Add to the termination message, when the container has one.

    Args:
        path: of the message; Kubernetes makes the file.
        message: keys to add.
    """
    if path.exists():
        text = path.read_text(encoding="utf-8")
        merged = {**(json.loads(text) if text else {}), **message}
        path.write_text(json.dumps(merged), encoding="utf-8")


def error_message(error: BaseException) -> dict[str, str]:
    """`{"error": …}`, shortened."""
    text = str(error)
    return {"error": text if len(text) <= ERROR_LIMIT else text[: ERROR_LIMIT - 1] + "…"}

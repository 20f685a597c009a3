"""Reads metadata from the comments at the head of a model: creators, date, licence."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from robovast.base.file_errors import read_text

_LINE = re.compile(
    r"^//\s*(?P<key>creator|contributor|license|description|modified)\s*:\s*(?P<value>.+?)\s*$",
    re.IGNORECASE,
)
_ORCID = re.compile(r"\(?<?(?:https?://orcid\.org/)?(\d{4}-\d{4}-\d{4}-\d{3}[\dX])>?\)?")


def read_about(path: Path) -> dict[str, Any]:
    """`creators` and `contributors` (`{name, orcid}`), `license`, `description`, `modified`.

    The last is the date in the comments, or else the file's modification time (ISO 8601, UTC).

    Raises:
        InputError: the file cannot be read.
    """
    text = read_text(path)
    changed = datetime.fromtimestamp(int(path.stat().st_mtime), UTC)
    about: dict[str, Any] = {"creators": [], "contributors": [], "modified": changed.isoformat()}
    for line in text.splitlines():
        match = _LINE.match(line)
        if match is None:
            continue
        key, value = match["key"].lower(), match["value"]
        if key in ("creator", "contributor"):
            about[f"{key}s"].append(_person(value))
        else:
            about[key] = value
    return about


def _person(text: str) -> dict[str, str]:
    """A name, with the ORCID beside it."""
    match = _ORCID.search(text)
    name = _ORCID.sub("", text).strip(" ,")
    return {"name": name, **({"orcid": match[1]} if match else {})}

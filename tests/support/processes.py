"""Processes of this machine, as /proc shows them."""

from __future__ import annotations

from pathlib import Path


def marked(word: str) -> list[Path]:
    """Processes whose command line holds a word."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if word.encode() in (folder / "cmdline").read_bytes().split(b"\0"):
                found.append(folder)
        except OSError:
            continue
    return found

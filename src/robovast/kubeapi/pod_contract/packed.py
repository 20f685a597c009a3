"""Files as text, for pods in a cluster that has no ConfigMap with them."""

from __future__ import annotations

import base64
import gzip

PACKED = ".packed"
"""Folder in `Mount.FILES` of packed files, each below it in its own place."""


def pack(content: bytes) -> str:
    """A file's content as text; the same content is always the same text."""
    return base64.b64encode(gzip.compress(content, mtime=0)).decode()


def unpack(text: bytes) -> bytes:
    """The content of a packed file."""
    return gzip.decompress(base64.b64decode(text))

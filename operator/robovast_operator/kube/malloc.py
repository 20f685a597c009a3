"""Returns freed memory to the system, which large documents would otherwise keep occupied."""

from __future__ import annotations

import ctypes

M_MMAP_THRESHOLD, M_ARENA_MAX = -3, -8
"""Parameters of glibc's mallopt; other C libraries have none, and need none."""


def adjust() -> None:
    """Allocate large blocks directly from the kernel, and return freed blocks to the kernel."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(M_MMAP_THRESHOLD, 65536)
        mallopt(M_ARENA_MAX, 2)


def trim() -> None:
    """Return free memory that lies between used memory."""
    malloc_trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if malloc_trim is not None:
        malloc_trim(0)

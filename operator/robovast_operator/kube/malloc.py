"""Returning freed memory to the system, which many large documents would otherwise keep."""

from __future__ import annotations

import ctypes

M_MMAP_THRESHOLD, M_ARENA_MAX = -3, -8
"""Parameters of glibc's mallopt; other C libraries have none, and need none."""


def adjust() -> None:
    """Let large pieces of memory come from the kernel alone, and go there once they are freed."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(M_MMAP_THRESHOLD, 65536)
        mallopt(M_ARENA_MAX, 2)


def trim() -> None:
    """Return what is free between what is in use."""
    malloc_trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if malloc_trim is not None:
        malloc_trim(0)

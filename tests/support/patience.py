"""Waiting in tests for what happens elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

PATIENCE = 180.0
"""How long to wait for what takes a moment: other tests may have the CPUs meanwhile [s]."""


def eventually(
    condition: Callable[[], Any], seconds: float = PATIENCE, told: str | Callable[[], object] = ""
) -> Any:
    """What a condition gives as soon as that is true; if it never is, show what is told then.

    It is asked often at first and ever less so, since to ask a cluster takes work.
    """
    begin = time.monotonic()
    pause = 0.02
    while not (found := condition()):
        waited = time.monotonic() - begin
        if waited > seconds:
            what = told if isinstance(told, str) else told()
            raise AssertionError(f"it did not happen in {seconds:g} s: {what}")
        time.sleep(pause)
        pause = max(min(0.5, pause * 1.7), min(1.5, waited / 20))
    return found

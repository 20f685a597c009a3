"""What a command writes to a terminal."""

from __future__ import annotations

import os
import pty
import subprocess
from collections.abc import Sequence
from pathlib import Path

from support.patience import PATIENCE


def shown_on_terminal(command: Sequence[str | Path], cwd: Path) -> tuple[int, str]:
    """Exit code of a command, and all that it writes to a terminal."""
    main, other = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100"}
    process = subprocess.Popen(command, cwd=cwd, stdout=other, stderr=other, env=environment)
    os.close(other)
    shown = read_all(main)
    return process.wait(PATIENCE), shown


def read_all(descriptor: int) -> str:
    chunks = []
    while True:
        try:
            chunk = os.read(descriptor, 65536)
        except OSError:  # Linux says so when the other side is closed
            break
        if not chunk:
            break
        chunks.append(chunk)
    os.close(descriptor)
    return b"".join(chunks).decode()

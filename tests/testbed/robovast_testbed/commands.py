"""Run a program to its end, or wait for a condition."""

import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from .errors import StartFailed

PATIENCE = 180.0
"""How long a part may take to be ready: others may have the CPUs meanwhile [s]."""


def run(
    command: Sequence[str | Path],
    *,
    cwd: Path | None = None,
    env: Mapping[str, str] | None = None,
    stdin: str | None = None,
) -> str:
    """Run a command and return its standard output.

    :raises StartFailed: with the end of both streams when the command fails.
    """
    result = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=env,
        input=stdin,
        capture_output=True,
        text=True,
        check=False,
    )
    if result.returncode != 0:
        tail = "\n".join((result.stdout + result.stderr).splitlines()[-30:])
        shown = " ".join(str(part) for part in command)
        raise StartFailed(f"{shown}: exit code {result.returncode}\n{tail}")
    return result.stdout


def wait_for(what: str, probe: Callable[[], bool], *, failed: Callable[[], str | None]) -> None:
    """Poll until `probe` holds.

    :param failed: says why waiting is pointless, or None while it is not.
    :raises StartFailed: when the time is over or `failed` names a reason.
    """
    deadline = time.monotonic() + PATIENCE
    while not probe():
        reason = failed()
        if reason is None and time.monotonic() > deadline:
            reason = f"not ready after {PATIENCE:.0f} s"
        if reason is not None:
            raise StartFailed(f"{what}: {reason}")
        time.sleep(0.1)

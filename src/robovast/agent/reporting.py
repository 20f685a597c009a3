"""Tells an error of a command by the log, the termination message and the exit code."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from robovast.base.errors import RobovastError
from robovast.base.file_errors import sentence
from robovast.kubeapi.pod_contract.exit_codes import exit_code_of_error
from robovast.kubeapi.pod_contract.messages import write_error


def run_and_report(work: Callable[[], int], message: Path, *, as_json: bool) -> int:
    """Do work; return its exit code, or that of its error, which is told.

    Args:
        work: what to do.
        message: file of the termination message.
        as_json: whether the message is JSON, of which the error is a part.
    """
    try:
        return work()
    except (RobovastError, OSError) as error:
        text = sentence(error) if isinstance(error, OSError) else str(error)
        print(f"error: {text}", file=sys.stderr)  # noqa: T201
        with suppress(OSError):  # on a disk that is full; Kubernetes falls back to the log
            write_error(message, text, as_json=as_json)
        return exit_code_of_error(error)

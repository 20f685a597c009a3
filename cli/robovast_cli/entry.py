"""Entry point of the command `vast`; it runs before any slow import."""

from __future__ import annotations

import os
import signal


def main() -> None:
    """Run `vast`; exits with a code of `ExitCode`.

    Ctrl-C while it is still being loaded ends it at once, without a traceback: nothing has begun.
    """
    loud = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if loud:
        signal.signal(signal.SIGINT, _end)
    from robovast_cli.main import main as run

    if loud:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    run()


def _end(number: int, frame: object) -> None:
    del number, frame
    os.write(2, b"interrupted\n")
    os._exit(130)

"""Entry points of `vast` and of `kubectl vast`; they run before any slow import."""

from __future__ import annotations

import gc
import os
import signal
import sys

_ALLOCATIONS = 100_000
"""Objects after which the collector looks for cycles. The runs of a large campaign stay; looking
through them every 700 objects, as is usual, takes a tenth of the time to read them."""


def main() -> None:
    """Run `vast`; exits with a code of `ExitCode`.

    Ctrl-C while it is still being loaded ends it at once, without a traceback: nothing has begun.
    """
    loud = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if loud:
        signal.signal(signal.SIGINT, _end)
    gc.set_threshold(_ALLOCATIONS)
    from robovast_cli.main import main as run

    if loud:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    run()


def kubectl() -> None:
    """Run `kubectl vast …`, which is `vast exec cluster …`; exits with a code of `ExitCode`."""
    sys.argv[1:1] = ["exec", "cluster"]
    main()


def _end(number: int, frame: object) -> None:
    del number, frame
    os.write(2, b"interrupted\n")
    os._exit(130)

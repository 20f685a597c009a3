"""Reports errors to the user, and determines the exit code."""

from __future__ import annotations

import contextlib
import logging
import os
import sys
import traceback
from collections.abc import Iterator

import typer

from robovast.base.errors import DocumentError, ExitCode, RobovastError
from robovast.base.file_errors import is_refusal, sentence
from robovast.base.optional_deps import missing_extra
from robovast.base.printable import printable
from robovast.base.task_record import report

BROKEN_PIPE = 141
"""Exit code when the reader of the output has gone, as of every program that SIGPIPE ends."""


@contextlib.contextmanager
def errors_reported() -> Iterator[None]:
    """Turn every exception into a message on stderr and an exit code.

    Raises:
        typer.Exit: with the code, after the message was printed.
    """
    try:
        yield
        sys.stdout.flush()
    except RobovastError as error:
        _show_traceback()
        tell(message_of(error))
        report(error=printable(message_of(error)))
        raise typer.Exit(error.exit_code) from None
    except KeyboardInterrupt:
        tell("interrupted")
        raise typer.Exit(ExitCode.INTERRUPTED) from None
    except BrokenPipeError:
        silence_stdout()
        raise typer.Exit(BROKEN_PIPE) from None
    except (typer.Exit, typer.Abort, typer.TyperException):
        raise
    except Exception as error:
        _show_traceback()
        if lacking := missing_extra(error):
            tell(message_of(lacking))
            raise typer.Exit(lacking.exit_code) from None
        if isinstance(error, OSError) and is_refusal(error):
            silence_stdout()  # what it holds would fail once more, if that is what has failed
            tell(f"error: {sentence(error)}")
            raise typer.Exit(ExitCode.STORAGE) from None
        cause = f"{type(error).__name__}: {error}".rstrip(": ").replace("\n", " ")
        tell(f"error: a bug in RoboVAST: {cause} (`vast -l debug …` shows the traceback)")
        raise typer.Exit(ExitCode.INTERNAL) from None


def silence_stdout() -> None:
    """Let nothing more fail because the reader of stdout has gone."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def message_of(error: RobovastError) -> str:
    """Return the message of an error for the user."""
    if not isinstance(error, DocumentError):
        return f"error: {error}"
    count = len(error.problems)
    files = dict.fromkeys(str(problem.place.file) for problem in error.problems)
    found = "1 problem" if count == 1 else f"{count} problems"
    return f"{error}\nerror: {found} in {', '.join(files)}"


def _show_traceback() -> None:
    if logging.getLogger().isEnabledFor(logging.DEBUG):
        traceback.print_exc()


def tell(text: str) -> None:
    """Print a line safely on stderr; errors of a closed stderr are ignored."""
    with contextlib.suppress(OSError):
        print(printable(text), file=sys.stderr, flush=True)  # noqa: T201

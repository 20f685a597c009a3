"""Reports errors to the user, and determines the exit code."""

from __future__ import annotations

import contextlib
import logging
import os
import re
import sys
import traceback
from collections.abc import Iterator

import typer

from robovast.base.errors import DocumentError, ExitCode, RobovastError
from robovast.base.file_errors import is_refusal, refusal
from robovast.base.optional_deps import missing_extra
from robovast.base.printable import printable
from robovast.base.task_record import report
from robovast_cli.ui.table import counted

_PERIOD = re.compile(r"(?<![./\s])\.$")
"""The period of a sentence, not of a path such as `..` or `/data/.`."""
_SENTENCES = re.compile(r"[^.]\. +[A-Z`$]")
"""Where a sentence follows another one."""
BROKEN_PIPE = 141
"""Exit code if the output cannot be written to a closed pipe, as after SIGPIPE."""


@contextlib.contextmanager
def report_errors() -> Iterator[None]:
    """Turn every exception into a message on stderr and an exit code.

    Raises:
        typer.Exit: with the code, after the message was printed.
    """
    try:
        yield
        sys.stdout.flush()
    except RobovastError as error:
        _show_traceback()
        echo_stderr(message_of(error))
        report(error=printable(message_of(error)))
        raise typer.Exit(error.exit_code) from None
    except KeyboardInterrupt:
        echo_stderr("interrupted")
        raise typer.Exit(ExitCode.INTERRUPTED) from None
    except BrokenPipeError:
        silence_stdout()
        raise typer.Exit(BROKEN_PIPE) from None
    except (typer.Exit, typer.Abort, typer.TyperException):
        raise
    except Exception as error:
        _show_traceback()
        if lacking := missing_extra(error):
            echo_stderr(message_of(lacking))
            raise typer.Exit(lacking.exit_code) from None
        if isinstance(error, OSError) and is_refusal(error):
            silence_stdout()  # what it holds would fail once more, if that is what has failed
            echo_stderr(in_form(*refusal(error)))
            raise typer.Exit(ExitCode.STORAGE) from None
        cause = f"{type(error).__name__}: {error}".rstrip(": ").replace("\n", " ")
        bug, remedy = f"a bug in RoboVAST: {cause}", "run `vast -l debug …` to see the traceback"
        echo_stderr(in_form(bug, remedy))
        raise typer.Exit(ExitCode.INTERNAL) from None


def silence_stdout() -> None:
    """Discard further output on stdout, because its reader has closed the pipe."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def message_of(error: RobovastError) -> str:
    """Return the message of an error for the user."""
    if not isinstance(error, DocumentError):
        return in_form(error.message, error.hint)
    count = len(error.problems)
    files = dict.fromkeys(str(problem.place.file) for problem in error.problems)
    found = counted(count, "problem")
    return f"{error}\nerror: {found} in {', '.join(files)}"


def in_form(message: str, hint: str = "") -> str:
    """Return the lines of an error: `error: <what failed>: <cause>`, then `hint: <what to do>`."""
    lines = [f"error: {_line(message)}", *([f"hint: {_line(hint)}"] if hint else ())]
    return "\n".join(lines)


def _line(text: str) -> str:
    """A text, which ends with a period only if it has several sentences."""
    bare = text.rstrip()
    if _SENTENCES.search(bare):
        return bare if bare.endswith((".", "?", "!", "…")) else f"{bare}."
    return _PERIOD.sub("", bare)


def _show_traceback() -> None:
    if logging.getLogger().isEnabledFor(logging.DEBUG):
        traceback.print_exc()


def echo_stderr(text: str) -> None:
    """Print a line safely on stderr; errors of a closed stderr are ignored."""
    with contextlib.suppress(OSError):
        print(printable(text), file=sys.stderr, flush=True)  # noqa: T201

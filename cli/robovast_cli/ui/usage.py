"""Rewords errors of Typer and pydantic about the command line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import typer

from robovast.base.paths import normalized
from robovast_cli.ui.report import echo_stderr, in_form

_TOO_MANY = "Got unexpected extra argument"
_VAST_FILE = "pass the .vast file before the command: `vast -V FILE …`"
_SEVERAL_FILES = "if a `*` on the command line matches several files or folders, name one"
_KINDS = {"int": "N", "float": "NUMBER", "str": "TEXT"}
"""Names of types in the help."""
_EXTRA = re.compile(r"  \[(?:default: ([^];]*))?(?:; )?([^]]*)\]$")
"""Suffix of Typer: default, range of a number, `required`."""


class UsageError(typer.BadParameter):
    """A wrong use of the command line."""

    def __init__(self, message: str, ctx: Any, param: Any = None, *, hint: str) -> None:
        super().__init__(message, ctx, param)
        self.hint = hint

    def format_message(self) -> str:
        """The message, which begins with the option if one is at fault."""
        return super().format_message() if self.param else self.message


@contextmanager
def explain_usage_errors() -> Iterator[None]:
    """Reword errors about the command line and print them, below the usage of the command.

    Raises:
        typer.Exit: with the code of the error, after the error was printed.
    """
    try:
        yield
    except typer.TyperException as error:
        if type(error).__name__ == "NoArgsIsHelpError":
            raise  # its message is the help of the command
        message, hint = _as_cli_error(error)
        ctx = getattr(error, "ctx", None)
        usage = f"{ctx.get_usage()}\n\n" if ctx else ""
        help_option = f"run `{ctx.command_path} --help`" if ctx else ""
        echo_stderr(f"{usage}{in_form(message, hint or help_option)}")
        raise typer.Exit(error.exit_code) from None


def _as_cli_error(error: Any) -> tuple[str, str]:
    """The message of an error and its hint, which may be empty."""
    details: list[Any] = getattr(error.__cause__, "errors", list)()
    if details and isinstance(error, typer.BadParameter):
        error.message, hint = _value(error, details[0])
        return _lowered(error.format_message()), hint
    if near := sorted(getattr(error, "possibilities", None) or ()):
        return _lowered(error.message), f"did you mean {', '.join(near)}?"
    if error.message.startswith(_TOO_MANY):
        return _lowered(error.message), _VAST_FILE if ".vast" in error.message else _SEVERAL_FILES
    message, mark, near = error.format_message().partition(". Did you mean ")
    return _lowered(message), getattr(error, "hint", "") or (f"did you mean {near}" if mark else "")


def _value(error: Any, details: Any) -> tuple[str, str]:
    """What is wrong with a value, and the nearest choice, if there are choices."""
    from robovast.model.document.problems import nearest, sentence

    choices = [str(choice) for choice in error.param.type_descriptor.choices or ()]
    if not choices:
        return sentence(details), ""
    given = details["input"]
    near = nearest(str(given), choices)
    wrong = f"must be one of {', '.join(choices)}, not {given!r}"
    return wrong, f"did you mean {near!r}?" if near else ""


def _lowered(text: str) -> str:
    return text[:1].lower() + text[1:] if text[1:2].islower() else text


def name_parameters(command: Any) -> Any:
    """Return a command whose help has the names of values and defaults of the style guide."""
    for param in command.params:
        param.get_help_record = partial(_help_record, param.get_help_record)
        if param.param_type_name == "argument":
            param.display_type_rich = _nothing
            param._usage_display_name = lambda p=param: _in_usage(p)
        elif param.metavar is None and not param.type_descriptor.is_choice:
            kind = param.type_descriptor.annotation
            param.metavar = _KINDS.get(getattr(kind, "__name__", ""))
    for child in getattr(command, "commands", {}).values():
        name_parameters(child)
    return command


def normalize_paths(command: Any) -> Any:
    """Return a command that receives all its paths without `..`; see `normalized`."""
    for param in command.params:
        if param.type_descriptor.annotation is Path and param.callback is None:
            param.callback = _normalized
    for child in getattr(command, "commands", {}).values():
        normalize_paths(child)
    return command


def _normalized(_ctx: object, _param: object, value: Any) -> Any:
    return normalized(value) if isinstance(value, Path) else value


def reject_second_context(command: Any) -> Any:
    """Return the command, which rejects a second `--context`, since it uses one cluster."""
    for param in command.params:
        if param.name == "context":
            command.parse_args = _single(command, param)
    for child in getattr(command, "commands", {}).values():
        reject_second_context(child)
    return command


def _single(command: Any, param: Any) -> Any:
    parse = command.parse_args

    def parse_args(ctx: Any, args: list[str]) -> Any:
        _, _, order = command.make_parser(ctx).parse_args(list(args))
        if order.count(param) > 1:
            raise UsageError(
                "is given twice, but this command uses one cluster",
                ctx,
                param,
                hint="name one, and run the command again for each other cluster",
            )
        return parse(ctx, args)

    return parse_args


def _help_record(original: Any, ctx: Any) -> tuple[str, str] | None:
    """Return name and help of a parameter, with "(default: X)" in its first sentence."""
    record: tuple[str, str] | None = original(ctx)
    found = _EXTRA.search(record[1]) if record else None
    if record is None or found is None:
        return record
    text, (default, rest) = record[1][: found.start()], found.groups("")
    if default:
        sentence, stop, more = f"{text} ".partition(". ")
        text = f"{sentence.rstrip()} (default: {default}){stop}{more}".rstrip()
    extra = [_range(part) for part in rest.split("; ") if part]
    return record[0], "  ".join([text, *(f"[{', '.join(extra)}]" for _ in extra[:1])])


def _range(text: str) -> str:
    """Return the range of a number, `1<=x<=9`, in words; other text unchanged."""
    low, sign, rest = text.partition("<=x")
    if sign:
        return f"{low} to {rest.removeprefix('<=')}"
    return f"at least {text.removeprefix('x>=')}" if text.startswith("x>=") else text


def _nothing(ctx: object) -> str:
    del ctx
    return ""


def _in_usage(param: Any) -> str:
    name = f"{param.display_name_raw}{'...' if param.nargs != 1 else ''}"
    return name if param.required else f"[{name}]"

"""The help of every command has the form of docs/contributing/style.md."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from typing import Any

import pytest
import typer
from support.command_tree import commands

from robovast_cli.lazy import LazyCommand
from robovast_cli.main import command

LONGEST_SUMMARY = 70
WIDTH = 100

SAME = {"evaluation mcp-server": "mcp", "results import-results": "import-results"}
"""Commands whose help is that of another one."""

COMMANDS = dict(commands())
LEAVES = [path for path, real in COMMANDS.items() if not getattr(real, "commands", None)]


def summary(text: str) -> str:
    return text.split("\n\n")[0].replace("\n", " ")


def help_of(path: str, real: Any) -> str:
    settings = {**real.context_settings, "terminal_width": WIDTH}
    return str(real.get_help(typer.Context(real, info_name=f"vast {path}".strip(), **settings)))


def examples_of(path: str) -> list[str]:
    """The commands of the examples, without their effects."""
    block = COMMANDS[path].help.partition("Examples:\n")[2]
    return re.findall(r"^ +(vast .*?)(?: [|>] .*|  .*)?$", block, re.MULTILINE)


def parsed(words: list[str]) -> str:
    """The command that a command line calls, whose arguments and options are parsed."""
    name, *rest = words
    ctx = command().make_context(name, rest)
    path = []
    while getattr(ctx.command, "commands", None):
        arguments = [*ctx._protected_args, *ctx.args]
        called, real, rest = ctx.command.resolve_command(ctx, arguments)
        ctx = real.make_context(called, rest, parent=ctx)
        path.append(called)
    return " ".join(path)


def lines_of_tables(group: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """The line of each lazy command in the help of its group."""
    for name, child in getattr(group, "commands", {}).items():
        below = f"{path} {name}".strip()
        if isinstance(child, LazyCommand) and not child.hidden:
            yield below, str(child.help)
            yield from lines_of_tables(child.load(), below)


@pytest.mark.parametrize("path", COMMANDS)
def test_the_summary_is_a_short_sentence(path: str) -> None:
    text = summary(COMMANDS[path].help)
    assert len(text) <= LONGEST_SUMMARY
    assert re.fullmatch(r"[A-Z].*[^.]\.", text), text
    assert ". " not in text


def test_a_group_shows_the_summary_of_its_commands() -> None:
    lines = dict(lines_of_tables(command()))
    assert lines.keys() >= {"exec local", "results summary"}
    assert {path: lines[path] for path in COMMANDS if path in lines} == {
        path: summary(real.help) for path, real in COMMANDS.items() if path in lines
    }


@pytest.mark.parametrize("path", LEAVES)
def test_each_command_has_two_examples_that_parse(path: str) -> None:
    found = [shlex.split(line) for line in examples_of(path)]
    assert len(found) >= 2
    own = [words for words in found if parsed(words) == SAME.get(path, path)]
    assert len(own) >= 2, "another command's example does not count"


@pytest.mark.parametrize("path", COMMANDS)
def test_no_line_is_too_wide(path: str) -> None:
    lines = help_of(path, COMMANDS[path]).splitlines()
    assert [line for line in lines if len(line) > WIDTH] == []


@pytest.mark.parametrize("path", COMMANDS)
def test_defaults_have_one_notation(path: str) -> None:
    text = help_of(path, COMMANDS[path])
    assert not re.search(r"\[default|when omitted|by default|may be repeated", text)
    assert text.count("(repeatable)") == sum(
        getattr(param, "multiple", False) and not param.hidden for param in COMMANDS[path].params
    )

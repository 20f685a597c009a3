"""`vast` as a whole: help, names of groups, global options, exit codes of faults."""

from __future__ import annotations

import copy
import errno
import json
import subprocess
import sys
from pathlib import Path

import pytest

from robovast import __version__
from robovast.base.errors import StorageError
from robovast_cli.commands.config import listing
from robovast_cli.main import COMMANDS


def test_help_names_every_command_once_and_no_alias(vast) -> None:
    outcome = vast("--help")
    names = [line.split()[0] for line in outcome.out.partition("Commands:\n")[2].splitlines()]
    assert names[: len(COMMANDS)] == list(COMMANDS)
    assert "configuration" not in names
    assert outcome.code == 0


@pytest.mark.parametrize(("short", "long"), [("config", "configuration"), ("exec", "execution")])
def test_groups_have_a_long_name(vast, short: str, long: str) -> None:
    help_of_long = vast(long, "--help").out
    assert help_of_long == vast(short, "--help").out.replace(f"vast {short} ", f"vast {long} ")
    assert "Commands:" in help_of_long


def test_help_imports_no_command_and_nothing_heavy() -> None:
    script = (
        "import sys, contextlib\n"
        "from robovast_cli.main import command\n"
        "with contextlib.suppress(SystemExit): command()(['--help'], prog_name='vast')\n"
        "print('LOADED', *sys.modules)\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    loaded = set(result.stdout.partition("LOADED ")[2].split())
    assert "typer.core" in loaded
    assert not loaded & {
        "robovast.model.document", "robovast_cli.commands.config.app", "pydantic.main",
        "yaml", "rich", "numpy",
    }  # fmt: skip


@pytest.mark.parametrize("module", ["local", "cluster.run"])
def test_only_what_talks_to_a_cluster_imports_its_client(module: str) -> None:
    arguments = ["exec", module.partition(".")[0], "run", "--help"]
    script = (
        "import sys, contextlib\n"
        "from robovast_cli.main import command\n"
        f"with contextlib.suppress(SystemExit): command()({arguments})\n"
        "print('LOADED', *sys.modules)\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    loaded = set(result.stdout.partition("LOADED ")[2].split())
    assert f"robovast_cli.commands.exec.{module}" in loaded
    assert not loaded & {"kubernetes", "aiohttp"}


def test_version(vast) -> None:
    assert vast("--version").out == f"vast {__version__}\n"


def test_the_log_level_shows_what_variations_tell(vast, sweep: Path, caplog) -> None:
    vast("-l", "info", "config", "list")
    assert vast("-l", "loud", "config", "list").code == 2


def fail_with(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def broken(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(listing, "print_configurations", broken)


def test_a_fault_is_one_message_and_code_70(vast, sweep, monkeypatch) -> None:
    fail_with(monkeypatch, KeyError("x\ny"))
    outcome = vast("config", "list")
    assert outcome.code == 70
    assert outcome.err == (
        "error: a bug in RoboVAST: KeyError: 'x\\ny'\n"
        "hint: run `vast -l debug …` to see the traceback\n"
    )


def test_the_traceback_of_a_fault_is_shown_on_demand(vast, sweep, monkeypatch) -> None:
    fail_with(monkeypatch, KeyError("x"))
    assert "Traceback" in vast("-l", "debug", "config", "list").err


@pytest.mark.parametrize("arguments", ["--help", "config list", "config list -o json"])
def test_output_that_a_full_disk_does_not_take_is_one_message(sweep: Path, arguments: str) -> None:
    with Path("/dev/full").open("w") as full:
        result = subprocess.run(
            [sys.executable, "-m", "robovast_cli", *arguments.split()],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    told = "error: the disk is full\nhint: free some space, then repeat the command\n"
    assert (result.returncode, result.stderr) == (5, told)


def test_what_the_machine_refuses_names_the_file(vast, sweep, monkeypatch) -> None:
    fail_with(monkeypatch, PermissionError(errno.EACCES, "Permission denied", "/x/y"))
    outcome = vast("config", "list")
    assert (outcome.code, outcome.err) == (5, "error: /x/y: Permission denied\n")


def test_errors_decide_the_exit_code(vast, sweep, monkeypatch) -> None:
    fail_with(monkeypatch, StorageError("the disk is full."))
    outcome = vast("config", "list")
    assert (outcome.code, outcome.err) == (5, "error: the disk is full\n")


@pytest.mark.parametrize(
    ("message", "hint", "printed"),
    [
        ("cannot write: it is a link.", "", "error: cannot write: it is a link\n"),
        (
            "cannot write: it is a link.",
            "choose another folder",
            "error: cannot write: it is a link\nhint: choose another folder\n",
        ),
        (
            "it is full. Nothing was stored",
            "free some space. `vast replay` repeats the run",
            "error: it is full. Nothing was stored.\n"
            "hint: free some space. `vast replay` repeats the run.\n",
        ),
        ("2 failed:\n    a\n    b", "use `…`", "error: 2 failed:\n    a\n    b\nhint: use `…`\n"),
        (
            "cannot reach https://me:pw@host",
            "check https://me:pw@host",
            "error: cannot reach https://host\nhint: check https://host\n",
        ),
    ],
)
def test_an_error_is_a_line_with_the_cause_and_one_with_the_remedy(
    vast, sweep, monkeypatch, message: str, hint: str, printed: str
) -> None:
    fail_with(monkeypatch, StorageError(message, hint=hint))
    assert vast("config", "list").err == printed


@pytest.mark.parametrize(
    ("message", "hint", "text"),
    [
        ("it is full", "", "it is full"),
        ("it is full.", "free some space", "it is full. Free some space."),
        ("it is full", "`rm x` frees some", "it is full. `rm x` frees some."),
        ("it is full", "did you mean `a`?", "it is full. Did you mean `a`?"),
    ],
)
def test_elsewhere_an_error_is_one_text(message: str, hint: str, text: str) -> None:
    error = StorageError(message, hint=hint)
    assert str(error) == str(copy.copy(error)) == text


def test_an_interrupt_is_quiet(vast, sweep, monkeypatch) -> None:
    fail_with(monkeypatch, KeyboardInterrupt())
    outcome = vast("config", "list")
    assert (outcome.code, outcome.err) == (130, "interrupted\n")


def test_output_can_be_parsed_whatever_the_log_level(vast, sweep) -> None:
    outcome = vast("-l", "debug", "config", "list", "-o", "json")
    assert len(json.loads(outcome.out)) == 7

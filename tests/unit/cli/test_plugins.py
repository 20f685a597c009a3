"""Commands of other distributions: Click and Typer, and those that are broken."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

MODULE = """\
import sys
import click
import typer

print("plugin imported", file=sys.stderr)


@click.command()
@click.option("--times", default=1, help="How often.")
@click.argument("rest", nargs=-1)
def hello(times, rest):
    "Say hello."
    click.echo(" ".join(["hello"] * times + list(rest)))


@click.group()
def variation():
    "Work on variations."


@variation.command("list")
@click.pass_context
def list_(ctx):
    "List them."
    click.echo(ctx.command_path)
    ctx.exit(3)


app = typer.Typer()


@app.command()
def show(name: str, loud: bool = False):
    "Show a name."
    print(name.upper() if loud else name)


@app.command()
def other():
    pass


not_a_command = 42
"""

Install = Callable[..., None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Put a distribution with entry points on the path."""

    def put(group: str, name: str = "acme-tools", module: str = MODULE, **entries: str) -> None:
        site = tmp_path / name
        info = site / f"{name.replace('-', '_')}-1.2.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
        lines = [f"{key.replace('_', '-')} = {value}" for key, value in entries.items()]
        (info / "entry_points.txt").write_text("\n".join([f"[{group}]", *lines, ""]))
        (site / f"{name.replace('-', '_')}_cli.py").write_text(module)
        monkeypatch.syspath_prepend(site)
        importlib.invalidate_caches()

    yield put
    for name in [name for name in sys.modules if name.endswith("_tools_cli")]:
        del sys.modules[name]


def test_a_click_command_gets_its_arguments_as_they_are(vast, install: Install) -> None:
    install("robovast.cli_plugins", hello="acme_tools_cli:hello")
    assert vast("hello", "--times", "2", "--", "-x").out == "hello hello -x\n"


def test_a_click_group_under_the_other_entry_point_group(vast, install: Install) -> None:
    install("vast.plugins", variation="acme_tools_cli:variation")
    outcome = vast("variation", "list")
    assert (outcome.code, outcome.out) == (3, "vast variation list\n")
    assert "Usage: vast variation [OPTIONS] COMMAND" in vast("variation", "--help").out
    wrong = vast("variation", "frob")
    assert wrong.code == 2
    assert "No such command 'frob'" in wrong.err


def test_a_typer_app(vast, install: Install) -> None:
    install("robovast.cli_plugins", acme="acme_tools_cli:app")
    assert vast("acme", "show", "door", "--loud").out == "DOOR\n"


def test_help_names_plugins_without_importing_them(vast, install: Install) -> None:
    install("robovast.cli_plugins", hello="acme_tools_cli:hello")
    outcome = vast("--help")
    assert outcome.out.splitlines()[-1].split() == ["hello", "Plugin", "of", "acme-tools", "1.2."]
    assert outcome.err == ""
    vast("config", "schema")
    assert "acme_tools_cli" not in sys.modules


def test_a_plugin_in_both_groups_is_one_command(vast, install: Install) -> None:
    for group, name in (("robovast.cli_plugins", "acme-tools"), ("vast.plugins", "acme-more")):
        install(group, name, hello="acme_tools_cli:hello")
    outcome = vast("--help")
    assert outcome.out.count("hello") == 1
    assert outcome.err == ""


@pytest.mark.parametrize(
    ("value", "cause"),
    [
        ("nowhere_cli:hello", "the module `nowhere_cli` does not exist"),
        (
            "no reference",
            "`no reference` is not of the form `package.module:command`",
        ),
    ],
)
def test_a_plugin_that_cannot_be_is_reported_and_left_out(
    vast, install: Install, value: str, cause: str
) -> None:
    install("robovast.cli_plugins", broken=value)
    outcome = vast("--help")
    assert outcome.code == 0
    assert "broken" not in outcome.out
    assert outcome.err == (f"warning: the command `broken` of acme-tools 1.2 is skipped: {cause}\n")


@pytest.mark.parametrize(
    ("module", "cause"),
    [
        ("import missing_thing", "ModuleNotFoundError: No module named 'missing_thing'"),
        ("raise SystemExit('no licence')", "SystemExit: no licence"),
        ("x = 1", "AttributeError: module 'acme_tools_cli' has no attribute 'hello'"),
    ],
)
def test_a_plugin_that_cannot_be_loaded_says_why(
    vast, install: Install, module: str, cause: str
) -> None:
    install("robovast.cli_plugins", module=module, hello="acme_tools_cli:hello")
    outcome = vast("hello")
    assert outcome.code == 3
    assert outcome.err == (
        "error: the command `hello` of acme-tools 1.2 cannot be loaded from "
        f"`acme_tools_cli:hello`: {cause}\nhint: update or remove that distribution\n"
    )
    assert vast("config", "schema").code == 0


def test_what_is_no_command_is_told(vast, install: Install) -> None:
    install("robovast.cli_plugins", number="acme_tools_cli:not_a_command")
    assert vast("number").err.endswith(
        "error: the command `number` of acme-tools 1.2 names `acme_tools_cli:not_a_command`, a "
        "int; it must be a Click command or group, or a Typer app\n"
        "hint: update or remove that distribution\n"
    )


def test_a_plugin_cannot_take_the_name_of_a_command(vast, install: Install) -> None:
    install("robovast.cli_plugins", config="acme_tools_cli:hello")
    outcome = vast("--help")
    assert "acme" not in outcome.out
    assert "`vast` has a command of that name" in outcome.err
    assert "Usage: vast config" in vast("config", "--help").out


def test_two_distributions_with_one_name(vast, install: Install) -> None:
    install("robovast.cli_plugins", hello="acme_tools_cli:hello")
    install("robovast.cli_plugins", "more-tools", hello="more_tools_cli:hello")
    outcome = vast("--help")
    assert outcome.out.count("hello") == 1
    assert "also has a plugin of that name" in outcome.err

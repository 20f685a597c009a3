"""`vast install-completion`."""

import os
import shlex
from pathlib import Path
from typing import Annotated, Literal

import typer
from typer.completion import (  # type: ignore[attr-defined]  # documented, not exported
    get_completion_script,
)

from robovast.base.atomic import write_atomically
from robovast.base.errors import InputError
from robovast.base.file_errors import read_text, writing
from robovast_cli.lazy import examples

Shell = Literal["bash", "zsh", "fish"]


@examples(
    ("vast install-completion", "Use the shell in $SHELL"),
    ("vast install-completion zsh", "Install completion for zsh"),
)
def install_completion(
    shell: Annotated[
        Shell | None, typer.Argument(help="Shell: bash, zsh or fish (default: from $SHELL).")
    ] = None,
) -> None:
    """Install command completion for your shell.

    Writes a script. For bash and zsh, also adds a line to `.bashrc` or `.zshrc` that loads it.
    """
    script = _install(shell or _own_shell(), Path.home())
    typer.echo(f"Completion is installed in {script}. Start a new shell, or run: source {script}")


def _own_shell() -> Shell:
    name = Path(os.environ.get("SHELL", "")).name
    for shell in ("bash", "zsh", "fish"):
        if name == shell:
            return shell
    raise InputError(
        f"$SHELL must be bash, zsh or fish, not {name or 'unset'}",
        hint="name the shell, for example `vast install-completion bash`",
    )


def _install(shell: Shell, home: Path) -> Path:
    text = get_completion_script(prog_name="vast", complete_var="_VAST_COMPLETE", shell=shell)
    data = Path(os.environ.get("XDG_DATA_HOME") or home / ".local/share")
    config = Path(os.environ.get("XDG_CONFIG_HOME") or home / ".config")
    script = {
        "bash": data / "robovast/completion.bash",
        "zsh": data / "robovast/completion.zsh",
        "fish": config / "fish/completions/vast.fish",
    }[shell]
    with writing(script):
        script.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(script, text + "\n")
        if shell == "bash":
            _add_line(home / ".bashrc", f"source {shlex.quote(str(script))}")
        elif shell == "zsh":
            load = f"autoload -Uz compinit && compinit && source {shlex.quote(str(script))}"
            _add_line(Path(os.environ.get("ZDOTDIR") or home) / ".zshrc", load)
    return script


def _add_line(path: Path, line: str) -> None:
    text = read_text(path) if path.exists() else ""
    if line not in text.splitlines():
        separator = "" if not text or text.endswith("\n") else "\n"
        with path.open("a", encoding="utf-8") as file:
            file.write(f"{separator}{line}\n")

"""Completion in shells: what is offered, and where it is installed."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from robovast_cli.main import command


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty home directory."""
    for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME", "ZDOTDIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    return tmp_path


def completions(monkeypatch: pytest.MonkeyPatch, capsys, line: str) -> list[str]:
    words = line.split(" ")
    monkeypatch.setenv("_VAST_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(len(words) - 1))
    with pytest.raises(SystemExit):
        command()(prog_name="vast")
    return capsys.readouterr().out.split()


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("vast con", ["config"]),
        ("vast config l", ["list"]),
        ("vast exec local run --res", ["--resume"]),
        ("vast exec local run --runtime p", ["podman", "process"]),
    ],
)
def test_commands_options_and_choices(monkeypatch, capsys, line: str, offered: list[str]) -> None:
    assert completions(monkeypatch, capsys, line) == offered


def test_a_click_plugin_completes_itself(monkeypatch, capsys, tmp_path: Path) -> None:
    (tmp_path / "acme-1.0.dist-info").mkdir()
    (tmp_path / "acme-1.0.dist-info" / "METADATA").write_text("Name: acme\nVersion: 1.0\n")
    (tmp_path / "acme-1.0.dist-info" / "entry_points.txt").write_text(
        "[robovast.cli_plugins]\nhello = acme_completion:hello\n"
    )
    (tmp_path / "acme_completion.py").write_text(
        "import click\n@click.command()\n@click.option('--times')\ndef hello(times): ...\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert completions(monkeypatch, capsys, "vast hello --ti") == ["--times"]


@pytest.mark.parametrize(
    ("shell", "script", "rc"),
    [
        ("bash", ".local/share/robovast/completion.bash", ".bashrc"),
        ("zsh", ".local/share/robovast/completion.zsh", ".zshrc"),
        ("fish", ".config/fish/completions/vast.fish", None),
    ],
)
def test_it_is_installed_once(vast, home: Path, shell: str, script: str, rc: str | None) -> None:
    if rc:
        (home / rc).write_text("alias x=y")
    for _ in range(2):
        assert vast("install-completion", shell).code == 0
    assert "_VAST_COMPLETE" in (home / script).read_text()
    if rc:
        lines = (home / rc).read_text().splitlines()
        assert lines[0] == "alias x=y"
        assert len(lines) == 2
        assert lines[1].endswith(f"source {home / script}")


def test_the_shell_is_that_of_the_user(vast, home: Path, monkeypatch) -> None:
    monkeypatch.setenv("SHELL", "/usr/bin/bash")
    assert vast("install-completion").code == 0
    assert (home / ".bashrc").is_file()
    monkeypatch.setenv("SHELL", "/bin/tcsh")
    outcome = vast("install-completion")
    assert outcome.code == 2
    assert "must be bash, zsh or fish, not tcsh" in outcome.err


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash_loads_what_was_written(vast, home: Path) -> None:
    vast("install-completion", "bash")
    result = subprocess.run(
        ["bash", "--norc", "-c", f"source {home / '.bashrc'}; complete -p vast"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "_vast_completion" in result.stdout

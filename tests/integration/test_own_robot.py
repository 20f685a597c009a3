"""The commands of docs/tutorials/own-robot.md that need no container, typed in the page's order."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from support.pages import ROOT

from robovast_cli.main import command

PAGE = ROOT / "docs/tutorials/own-robot.md"
TYPED = (
    "vast init",
    "vast config",
    "vast exec local prepare-run",
    "vast exec cluster run --dry-run",
)
VARIATIONS = "configuration:\n"


def test_the_commands_without_containers_print_what_the_page_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    printed, shown, typed = "", [], 0
    blocks = re.findall(r"^```(\w+)\n(.*?)^```$", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    for language, block in blocks:
        if name := re.match(r"# ([\w.-]+\.(?:vast|osc))\n", block):
            Path(name[1]).write_text(block, encoding="utf-8")
        elif language == "yaml" and block.startswith(VARIATIONS):
            with Path("my-robot.vast").open("a", encoding="utf-8") as file:
                file.write(block)
        elif language == "text":
            shown.append(block)
        for line in block.splitlines() if language == "bash" else ():
            if line.startswith(TYPED):
                with pytest.raises(SystemExit) as ended:
                    command().main(args=shlex.split(line)[1:], prog_name="vast")
                out, err = capsys.readouterr()
                assert ended.value.code == 0, f"{line}\n{out}{err}"
                printed, typed = printed + out, typed + 1
    assert len(shown) == 2
    assert typed == 8
    assert all(block in printed for block in shown)
    assert "kind: Campaign" in printed
    assert Path("test_run/run.sh").is_file()

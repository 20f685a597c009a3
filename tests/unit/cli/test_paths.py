"""A path on the command line means the same however it is written."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from shutil import copytree
from typing import Any

import pytest
import typer

from robovast.base.paths import normalized
from robovast_cli.lazy import LazyCommand
from robovast_cli.main import command

CASES = Path(__file__).parents[2] / "data" / "cases" / "bags"


def commands(group: Any) -> Iterator[Any]:
    yield group
    for child in getattr(group, "commands", {}).values():
        yield from commands(child.load() if isinstance(child, LazyCommand) else child)


def test_no_command_receives_a_path_with_dots(tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    found = 0
    for one in commands(command()):
        for param in one.params:
            if param.type_descriptor.annotation is Path:
                found += 1
                context = typer.Context(one)
                assert param.process_value(context, "../results") == tmp_path / "results"
                assert param.process_value(context, "results") == Path("results")
    assert found > 40


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("../results", "results"),
        ("../here/../results", "results"),
        ("link/../results", "far/results"),
        ("../results/..", "."),
        ("missing/../../results", "results"),
    ],
)
def test_parents_are_those_of_the_file_system(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: str, meant: str
) -> None:
    for folder in ("here", "results", "far/away", "far/results"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "here" / "link").symlink_to(tmp_path / "far" / "away")
    monkeypatch.chdir(tmp_path / "here")
    assert normalized(Path(given)) == tmp_path / meant
    assert normalized(tmp_path / "here" / given) == tmp_path / meant


@pytest.mark.parametrize("given", ["../results", "../here/../results", "a/../../results"])
def test_bags_are_converted_wherever_the_results_folder_is(
    vast, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: str
) -> None:
    (case,) = CASES.glob("b14-*")
    campaign = copytree(case, tmp_path / "results" / case.name)
    (tmp_path / "here" / "a").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "here")
    outcome = vast("results", "postprocess", "-r", given.format(tmp_path))
    assert (outcome.code, "failed" in outcome.err) == (0, False), outcome.err
    assert (campaign / "c" / "0" / "rosbag2_x.csv").is_file()

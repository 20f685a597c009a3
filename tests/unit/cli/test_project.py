"""`vast init` and how commands find their .vast file."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from robovast.model.project import PROJECT_FILE, find_project


def test_init_names_the_file_for_the_folder_and_those_below(vast, sweep, monkeypatch) -> None:
    folder = sweep.parent
    (folder / "other.vast").write_text("version: 1\n")
    outcome = vast("init", "drive.vast")
    assert outcome.code == 0
    assert outcome.out.splitlines()[0] == (
        f"Project file {PROJECT_FILE}: drive.vast, results in results."
    )
    (folder / "deep" / "er").mkdir(parents=True)
    monkeypatch.chdir(folder / "deep" / "er")
    assert len(vast("config", "list", "-o", "name").out.splitlines()) == 7


def test_the_option_goes_before_the_project(vast, sweep) -> None:
    (sweep.parent / "one.vast").write_text("version: 1\nexecution: {scenario_file: drive.osc}\n")
    vast("init", "drive.vast")
    assert vast("-V", "one.vast", "config", "list", "-o", "name").out == "config1\n"


def test_paths_in_the_project_file_are_relative_to_it(vast, sweep, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    vast("init", sweep, "-r", elsewhere / "runs", "--project-log-level", "info")
    assert (tmp_path / PROJECT_FILE).read_text() == (
        "config: drive.vast\nresults_dir: elsewhere/runs\nlog_level: info\n"
    )
    project = find_project(tmp_path)
    assert project is not None
    assert project.vast_file == sweep
    assert project.results_dir == elsewhere / "runs"


def test_the_projects_log_level_holds_unless_another_is_given(vast, sweep) -> None:
    vast("init", "drive.vast", "--project-log-level", "error")
    vast("config", "list")
    assert logging.getLogger().level == logging.ERROR
    vast("-l", "info", "config", "list")
    assert logging.getLogger().level == logging.INFO


def test_log_levels_are_read_in_any_case(vast, sweep) -> None:
    (sweep.parent / PROJECT_FILE).write_text("config: drive.vast\nlog_level: ERROR\n")
    assert vast("config", "list").code == 0
    assert logging.getLogger().level == logging.ERROR
    assert vast("-l", "Info", "config", "list").code == 0
    assert logging.getLogger().level == logging.INFO


def test_keys_of_other_versions_have_no_effect_in_a_project_file(vast, sweep) -> None:
    text = "config: drive.vast\nconfig_path: /old\ncluster: rke2\n"
    (sweep.parent / PROJECT_FILE).write_text(text)
    assert vast("config", "list").code == 0


def test_init_replaces_nothing_unless_forced(vast, sweep) -> None:
    vast("init", "drive.vast")
    before = (sweep.parent / PROJECT_FILE).read_text()
    outcome = vast("init", "drive.vast", "-r", "other")
    assert outcome.code == 2
    assert "exists already\nhint: use `--force` to replace it\n" in outcome.err
    assert (sweep.parent / PROJECT_FILE).read_text() == before
    assert vast("init", "drive.vast", "-r", "other", "--force").code == 0


def test_init_wants_a_file_that_exists(vast, folder) -> None:
    outcome = vast("init", "none.vast")
    assert outcome.code == 2
    assert outcome.err == (
        "error: none.vast: there is no such file\n"
        "hint: write the file as in docs/tutorials/own-robot.md, or copy an example from "
        "configs/examples\n"
    )
    assert not (folder / PROJECT_FILE).exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("confg: x.vast\n", ":1:1: confg: unknown key `confg`\n    Did you mean `config`?"),
        ("config: x.vast\nlog_level: loud\n", ":2:12: log_level: must be 'debug', 'info', "),
        ("- 1\n", ":1:1: a project file is a mapping\n    `vast init --force CONFIG`"),
    ],
)
def test_a_broken_project_file_is_explained(vast, sweep, text: str, message: str) -> None:
    (sweep.parent / PROJECT_FILE).write_text(text)
    outcome = vast("config", "list")
    assert outcome.code == 2
    assert f"{sweep.parent / PROJECT_FILE}{message}" in outcome.err
    assert vast("init", "drive.vast", "--force").code == 0

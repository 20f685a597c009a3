"""What of a bucket comes into a campaign's folder, and where: anybody chooses keys."""

from __future__ import annotations

import pytest

from robovast.campaign.object_keys import Keys, run_of, set_apart, why_no_place


@pytest.mark.parametrize(
    "key", ["../evil", "/etc/passwd", "hall/0/../../../evil", "a//b", "a/./b", "a/", "", ".", "a\0"]
)
def test_what_is_no_path_has_no_place(key: str) -> None:
    assert "not a path within a folder" in why_no_place(key)


@pytest.mark.parametrize(
    "key",
    [
        ".download/lock",
        ".download/hall/0.abc/x",
        ".bucket",
        ".bucket/x",
        ".aside/hall/0",
        ".running/lock",
        ".hall.12-0123abcd.part/x",
        ".hall.replaced",
    ],
)
def test_places_that_commands_keep_for_themselves_are_not_for_a_bucket(key: str) -> None:
    assert "reserved for the commands" in why_no_place(key)


def test_a_name_that_terminals_obey_is_no_configurations() -> None:
    assert "a configuration cannot" in why_no_place("hall\n\x1b[31m/0/run.json")


def test_a_record_is_no_folder() -> None:
    assert "run.json is not a folder" in why_no_place("hall/0/run.json/x")


@pytest.mark.parametrize(
    "key",
    [
        "_config/a.vast",
        ".cache/postprocessing.db",
        "hall/0/.hall.12-0123abcd.part",
        "hall/0/.download/lock",
        "hall/0/run.json",
        "hall/0/a/run.json/x",
        "hall/_config/ü\n",
    ],
)
def test_all_else_has_one(key: str) -> None:
    assert why_no_place(key) == ""


def test_a_file_that_is_a_folder_too_is_set_apart() -> None:
    paths = ["a", "a/b", "a/b/c", "a.1", "b", "c/d"]
    assert set_apart(paths) == {"a": "a.2", "a/b": "a/b.1"}
    assert set_apart(["a", "b/c"]) == {}


def test_runs_are_called_by_plain_digits() -> None:
    assert run_of("hall/12/x/y") == "hall/12"
    assert not any(map(run_of, ["hall/0", "_jobs/0/x", ".x/0/x", "hall/٣/x", "hall/²/x"]))


def test_what_is_stored_takes_no_other_files_place() -> None:
    there = Keys(["a", "a.1", "b/c", "b.1", "d/e"])
    assert [there.beside(key) for key in ("a", "x", "b/x", "d/e", "d/f")] == [
        "a", "x", "b/x", "d/e", "d/f"
    ]  # fmt: skip
    assert there.beside("a/x/y") == "a.2/x/y"
    assert there.beside("b") == "b.2"
    assert there.beside("b/c/x") == "b/c.1/x"

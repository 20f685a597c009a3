"""Each short option has one meaning in the whole command tree."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import pytest
from support.command_tree import commands

OF_THE_ORIGINAL = {
    "-c": {"--cluster-config": {"exec cluster cleanup"}},
    "-i": {"--image": {"exec local run"}, "--interval": {"exec cluster monitor"}},
    "-o": {
        "--option": {
            *(f"exec cluster {name}" for name in ("setup", "cleanup", "prepare-setup")),
            *(f"exec cluster {name}" for name in ("prepare-run", "run-cleanup")),
            "exec cluster download-cleanup",
        },
        "--override": {"results postprocess", "evaluation gui"},
    },
    "-r": {
        "--runs": {
            *(f"exec local {name}" for name in ("run", "prepare-run")),
            *(f"exec cluster {name}" for name in ("run", "prepare-run")),
        }
    },
}
"""Second meanings that commands of the original RoboVAST have: its scripts must keep working."""


def letters(real: Any) -> Iterator[tuple[str, str]]:
    for param in real.params:
        for name in (*param.opts, *param.secondary_opts):
            if name.startswith("-") and not name.startswith("--"):
                yield name, next(long for long in param.opts if long.startswith("--"))


def test_within_a_command_no_option_has_two_meanings() -> None:
    for path, real in commands():
        names = [name for param in real.params for name in (*param.opts, *param.secondary_opts)]
        names += real.context_settings.get("help_option_names", [])
        assert sorted(names) == sorted(set(names)), path


def test_across_commands_each_letter_has_one_meaning() -> None:
    meanings: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for path, real in commands():
        for letter, long in letters(real):
            meanings[letter][long].add(path)
    for letter, exceptions in OF_THE_ORIGINAL.items():
        for long, paths in exceptions.items():
            assert meanings[letter].pop(long) == paths, (letter, long)
    assert {letter: list(longs) for letter, longs in meanings.items() if len(longs) > 1} == {}


@pytest.mark.parametrize("option", [("-n", "3"), ("-x", "lab"), ("--namespace", "lab")])
def test_a_run_on_this_machine_is_in_no_cluster(vast, tmp_path, option: tuple[str, str]) -> None:
    outcome = vast("replay", *option, tmp_path / "c-2026-03-05-121530" / "one" / "0")
    assert outcome.code == 2
    assert f"hint: remove `{'--context' if option[0] == '-x' else '-n'}`" in outcome.err
    assert ("--times 3" in outcome.err) == (option == ("-n", "3"))

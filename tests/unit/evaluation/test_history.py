"""The history of a configuration lists every recorded input that changed, and says if none did."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.campaigns.stored import write, write_campaign

from robovast.base.statistics import wilson
from robovast.evaluation.campaign_index import CampaignIndex
from robovast.evaluation.configuration_index import ConfigurationIndex
from robovast.evaluation.history import HistoryEntry, history
from robovast.evaluation.rates import campaign_rates

FIRST, SECOND = (f"hall-2026-03-0{day}-132444" for day in (1, 2))
VAST = "execution: {scenario_file: scenario.osc, run_files: [files/*]}\n"
LARGE = 3 << 20
"""Size of a file that is too large to be compared line by line [bytes]."""


def campaign(results: Path, name: str, bad: int = 0) -> Path:
    root = write_campaign(
        results,
        name,
        variants=[{"speed": 2.0}],
        runs=4,
        judge=lambda _, number: "failed" if number < bad else "passed",
        outputs=False,
    )
    path = root / "_execution" / "execution.yaml"
    path.write_text(path.read_text().replace("2026-03-04T", f"{name[5:15]}T"))
    write(root / "_config" / "hall.vast", VAST)
    write(root / "_config" / "scenario.osc", "scenario drive\n")
    write(root / "_config" / "files" / "pilot.py", "AHEAD = 0.35\n")
    write(root / "_config" / "files" / "mesh.stl", "a" * LARGE)
    write(root / "hall-1" / "_config" / "map.pgm", "P5 map")
    return root


def entries(results: Path) -> list[HistoryEntry]:
    index = ConfigurationIndex(results.parent / "configurations.db")
    return list(history(results, SECOND, "hall-1", index).entries)


def in_file(path: str, text: str) -> Callable[[Path], None]:
    def change(root: Path) -> None:
        file = root / path
        before = file.stat() if file.exists() else None
        write(file, text)
        if before:
            os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns + 1))

    return change


def in_record(**values: object) -> Callable[[Path], None]:
    def change(root: Path) -> None:
        for file in root.glob("hall-1/*/run.json"):
            file.write_text(json.dumps(json.loads(file.read_text()) | values))

    return change


def in_execution(old: str, new: str) -> Callable[[Path], None]:
    def change(root: Path) -> None:
        file = root / "_execution" / "execution.yaml"
        text = file.read_text()
        assert old in text
        file.write_text(text.replace(old, new))

    return change


CHANGES = {
    "files/pilot.py": in_file("_config/files/pilot.py", "AHEAD = 0.90\n"),
    "files/mesh.stl": in_file("_config/files/mesh.stl", "a" * (LARGE - 1) + "b"),
    "files/new.py": in_file("_config/files/new.py", ""),
    "scenario": in_file("_config/scenario.osc", "scenario drove\n"),
    ".vast": in_file("_config/hall.vast", VAST + "# another\n"),
    "map.pgm": in_file("hall-1/_config/map.pgm", "P5 mop"),
    "image": in_record(image_digest="sha256:7"),
    "seed": in_record(seed=7),
    "environment": in_execution("execution_type", "env: {GAIN: '2'}\nexecution_type"),
    "RoboVAST": in_execution("robovast_version: 0.1.0", "robovast_version: 0.2.0"),
}


@settings(max_examples=25, deadline=None)
@given(st.sets(st.sampled_from(sorted(CHANGES))), st.integers(0, 4))
def test_each_recorded_change_is_listed_and_no_other(changed: set[str], bad: int) -> None:
    with TemporaryDirectory() as folder:
        results = Path(folder).resolve() / "results"
        campaign(results, FIRST)
        later = campaign(results, SECOND, bad)
        for name in changed:
            CHANGES[name](later)
        first, second = entries(results)
        assert (first.changes, first.changed) == ((), "")
        assert set(second.changes) == changed
        if not changed:
            assert second.changed == "nothing recorded changed"
        elif len(changed) <= 4:
            assert second.changed == ", ".join(second.changes)
        else:
            assert second.changed.endswith(f" and {len(changed) - 4} more")


def test_a_replay_is_not_counted_again(tmp_path: Path) -> None:
    campaign(tmp_path / "results", FIRST)
    campaign(tmp_path / "results", SECOND)
    replay = campaign(tmp_path / "results", "hall-replay-2026-03-03-132444")
    in_execution("execution_type", f"replay_of: {FIRST}/hall-1/0\nexecution_type")(replay)
    assert [one.campaign for one in entries(tmp_path / "results")] == [FIRST, SECOND]


@pytest.mark.parametrize("path", ["_config/files/pilot.py", "hall-1/_config/map.pgm"])
def test_a_file_that_is_gone_is_a_change(tmp_path: Path, path: str) -> None:
    campaign(tmp_path / "results", FIRST)
    (campaign(tmp_path / "results", SECOND) / path).unlink()
    assert entries(tmp_path / "results")[1].changed == path.rpartition("_config/")[2]


def test_a_changed_file_of_any_size_is_a_change_of_a_comparison(tmp_path: Path) -> None:
    from robovast.evaluation.campaign_inputs import changes

    results = tmp_path / "results"
    campaign(results, FIRST)
    CHANGES["files/mesh.stl"](campaign(results, SECOND))
    (found,) = changes((results, FIRST), (results, SECOND))
    assert (found.name, found.kind, found.lines) == ("files/mesh.stl", "changed", [])


@pytest.mark.parametrize("of_another_tool", [True, False])
def test_its_intervals_are_those_of_the_summary(tmp_path: Path, of_another_tool: bool) -> None:
    results = tmp_path / "results"
    root = campaign(results, SECOND, bad=1)
    if of_another_tool:
        (root / "_execution" / "execution.yaml").unlink()
    index = CampaignIndex(results, SECOND)
    index.refresh()
    (expected,) = campaign_rates(index.summary(), index.variants, 0.1).configurations
    (found,) = entries(results)
    assert found.rate.interval == expected.rate.interval == wilson(1, 4)

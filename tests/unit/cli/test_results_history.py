"""`vast results history`: one configuration over campaigns."""

from __future__ import annotations

import json
import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from support.campaigns.stored import write, write_campaign

from robovast.evaluation import configuration_index

DAYS = [f"hall-2026-03-0{day}-132444" for day in range(1, 5)]


def campaign(results: Path, name: str, speeds: tuple[float, ...], bad: int, **record) -> Path:
    """A campaign in which the speed 2 fails so often, executed on the date in its name."""
    root = write_campaign(
        results,
        name,
        variants=[{"speed": speed} for speed in speeds],
        runs=4,
        judge=lambda parameters, n: "failed" if parameters["speed"] == 2 and n < bad else "passed",
        outputs=False,
    )
    path = root / "_execution" / "execution.yaml"
    path.write_text(path.read_text().replace("2026-03-04T", f"{name[5:15]}T"))
    write(root / "_config" / "hall.vast", "execution: {scenario_file: scenario.osc}\n")
    write(root / "_config" / "scenario.osc", "scenario drive\n")
    for file in root.glob("*/*/run.json"):
        file.write_text(json.dumps(json.loads(file.read_text()) | record))
    return root


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Four campaigns; the last one has one more configuration before the others."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = tmp_path / "results"
    campaign(folder, DAYS[0], (1.0, 2.0), 0)
    write(campaign(folder, DAYS[1], (1.0, 2.0), 2) / "_config" / "scenario.osc", "another\n")
    campaign(folder, DAYS[2], (1.0, 2.0), 4, image_digest="sha256:7")
    last = campaign(folder, DAYS[3], (0.5, 1.0, 2.0), 1, image_digest="sha256:7")
    write(last / "_config" / "hall.vast", "execution: {scenario_file: scenario.osc}\nx: 1\n")
    return folder


def test_it_says_how_often_it_failed_and_what_changed(vast, results) -> None:
    outcome = vast("results", "history", "hall-3")
    assert outcome.code == 0
    rows = [" ".join(line.split()) for line in outcome.out.splitlines()]
    assert [row.removesuffix(" goal not reached: no goal after 20 s") for row in rows] == [
        "STARTED UNSUCCESSFUL RATE 95 % INTERVAL CHANGED CAMPAIGN REASON",
        f"2026-03-01 13:24 ○ 0 of 4 0 % 0 – 49 % {DAYS[0]}/hall-2",
        f"2026-03-02 13:24 ◐ 2 of 4 50 % 15 – 85 % scenario {DAYS[1]}/hall-2",
        f"2026-03-03 13:24 ● 4 of 4 100 % 51 – 100 % image, scenario {DAYS[2]}/hall-2",
        f"2026-03-04 13:24 ◐ 1 of 4 25 % 4.6 – 70 % .vast {DAYS[3]}/hall-3",
        "",
        "hall-3 ○◐●◐ in 4 campaigns",
        "○ all passed, ◐ some passed, ● none passed",
    ]


def test_other_parameters_are_another_configuration(vast, results) -> None:
    outcome = vast("results", "history", "hall-1")
    assert "hall-1  ○  in 1 campaign\n" in outcome.out
    assert "In 3 other campaigns, hall-1 has other parameters." in outcome.out
    for how in (["hall-1", "-i", DAYS[0]], [results / DAYS[0] / "hall-1"]):
        outcome = vast("results", "history", *how, "-o", "json")
        entries = json.loads(outcome.out)["entries"]
        assert [(one["campaign"], one["name"]) for one in entries] == [
            *((day, "hall-1") for day in DAYS[:3]),
            (DAYS[3], "hall-2"),
        ]


def test_a_campaign_is_searched_once(vast, results, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(configuration_index, "_SETTLED", -1)
    first = vast("results", "history", "hall-3").out
    monkeypatch.setattr(configuration_index, "read_parameters", lambda *_: pytest.fail("read"))
    assert vast("results", "history", "hall-3").out == first
    monkeypatch.undo()
    monkeypatch.chdir(results.parent)
    campaign(results, DAYS[0], (1.0, 3.0, 2.0), 3)  # it gets a further configuration
    assert f"{DAYS[0]}/hall-3" in vast("results", "history", "hall-3").out


@pytest.mark.parametrize("content", ["no database", None])
def test_an_index_that_cannot_be_used_is_done_without(vast, results, content) -> None:
    path = results.parent / "cache" / "robovast" / "configurations.db"
    if content is None:
        path.mkdir(parents=True)
    else:
        write(path, content)
    assert "in 4 campaigns" in vast("results", "history", "hall-3").out


def test_a_damaged_index_is_made_anew(vast, results, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(configuration_index, "_SETTLED", -1)
    first = vast("results", "history", "hall-3").out
    path = results.parent / "cache" / "robovast" / "configurations.db"
    good = path.read_bytes()
    path.write_bytes(good[:4096] + b"\xff" * (len(good) - 4096))
    assert vast("results", "history", "hall-3").out == first
    assert vast("results", "history", "hall-3").out == first
    assert path.read_bytes() == good


def test_an_index_that_another_program_holds_is_not_waited_for(
    vast, results, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = vast("results", "history", "hall-3").out
    path = results.parent / "cache" / "robovast" / "configurations.db"
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("BEGIN EXCLUSIVE")
        waits: list[float] = []
        connect = sqlite3.connect

        def connected(*place, timeout: float = 5.0, **options):
            waits.append(timeout)
            return connect(*place, timeout=timeout, **options)

        monkeypatch.setattr(sqlite3, "connect", connected)
        assert vast("results", "history", "hall-3").out == first
    assert waits
    assert sum(waits) < 4.0


def test_what_an_old_index_says_is_not_believed(
    vast, results, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(configuration_index, "_SETTLED", -1)
    assert "in 4 campaigns" in vast("results", "history", "hall-3").out
    path = results.parent / "cache" / "robovast" / "configurations.db"
    with closing(sqlite3.connect(path)) as index, index:
        index.execute("UPDATE configuration SET name = 'hall-1' WHERE name = 'hall-2'")
    assert "in 1 campaign\n" in vast("results", "history", "hall-3").out


def test_a_configuration_that_is_still_written_is_found_later(
    vast, results, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(configuration_index, "_SETTLED", -1)
    runs, away = results / DAYS[0] / "hall-2", results / DAYS[0] / "_execution" / "away"
    changed = runs.stat().st_mtime_ns
    away.mkdir()
    for part in [*runs.iterdir()]:
        part.rename(away / part.name)
    assert "in 3 campaigns" in vast("results", "history", "hall-3").out
    for part in [*away.iterdir()]:
        part.rename(runs / part.name)
    os.utime(runs, ns=(changed, changed))
    assert "in 4 campaigns" in vast("results", "history", "hall-3").out


def test_what_cannot_be_read_is_left_out(vast, results) -> None:
    for file in (results / DAYS[1]).glob("hall-2/*/run.json"):
        file.write_bytes(b"\xff{")
    write(results / DAYS[2] / "_execution" / "execution.yaml", "{")
    assert "in 3 campaigns" in vast("results", "history", "hall-3").out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("hall-9",), "has a configuration `hall-9`"),
        (("../cache",), "has a configuration `../cache`"),
        (("hall-3", "-i", DAYS[0]), f"{DAYS[0]} has no configuration hall-3"),
        (("hall-3", "-i", "gone"), "no campaign `gone`"),
    ],
)
def test_bad_input_has_one_clear_message(vast, results, arguments, message) -> None:
    outcome = vast("results", "history", *arguments)
    assert (outcome.code, message in outcome.err) == (2, True)
    assert outcome.is_one_error

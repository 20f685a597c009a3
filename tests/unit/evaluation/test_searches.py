"""What the page shows of a search, of which nothing is executed."""

from __future__ import annotations

import json
import time
from pathlib import Path
from urllib.parse import urlencode

import pytest
from starlette.requests import Request
from support.campaigns.searches import QD, SEVERAL, write_search
from support.campaigns.stored import write_campaign

from robovast.base.errors import InputError
from robovast.base.serialization import dump_yaml
from robovast.base.yaml_files import read_mapping
from robovast.evaluation.campaigns import is_search
from robovast.evaluation.library import Library
from robovast.evaluation.searches import Searches, ShownSearch
from robovast.evaluation.server.searches import SearchPages


def found(root: Path) -> ShownSearch:
    return Searches(Library(root.parent)).of(root.name)


def test_a_failure_map_its_sets_and_its_critical_values(tmp_path: Path) -> None:
    search = found(write_search(tmp_path / "results"))
    overview = search.overview
    assert (overview["shown"], overview["batches"], overview["evaluated"]) == ("map", 4, 48)
    assert overview["ended"].reason == "batches: batches 4/4"
    assert overview["proposed"][2][:2] == (12, 24)
    assert len(overview["report"]["misjudged"]) == len(overview["report"]["best failure_rate"]) == 4
    wet = search.map("speed", "load", {"surface": 0.75})
    assert len(wet["rate"]) == len(wet["low"]) == wet["width"] * wet["height"] == 61 * 11
    row = wet["rate"][5 * 61 : 6 * 61]
    assert (row[0] < 100, row[-1] > 900) == (True, True)
    (speed, load) = wet["critical"]
    assert (speed["name"], load["name"]) == ("speed", "load")
    assert speed["low"] - 0.2 <= 2.75 <= speed["high"] + 0.2
    dry = search.map("speed", "load", {"surface": 0.25})["critical"][0]
    assert dry["value"] > speed["value"] + 0.5
    sets = search.sets("speed", "load")
    assert {len(sets[key]) for key in ("config", "value", "runs", "batch")} == {48}
    assert max(sets["x"]["places"]) <= 1.0
    with pytest.raises(InputError, match="two different parameters"):
        search.map("speed", "speed", {})
    with pytest.raises(InputError, match="`sped` is not a parameter"):
        search.sets("sped", "load")


def test_an_archive_and_a_front(tmp_path: Path) -> None:
    archive = found(write_search(tmp_path / "results", "ways-2026-03-07-100000", **QD))
    assert archive.overview["measures"][:2] == ["way", "time"]
    sets = archive.sets("way", "time")
    assert (sets["x"]["bins"], sets["x"]["ticks"][-1]) == (8, (1.0, "9"))
    assert len(sets["best"]) == archive.overview["report"]["num_elites"][-1]
    with pytest.raises(InputError, match="provides no failure map"):
        archive.map("speed", "load", {})
    front = found(write_search(tmp_path / "results", "both-2026-03-07-110000", **SEVERAL))
    sets = front.sets("failure_rate", "time")
    assert 0 < len(sets["best"]) < len(sets["config"])
    assert {"best failure_rate", "best time"} < set(front.overview["report"])


def test_code_in_a_stored_campaign_is_not_executed(tmp_path: Path) -> None:
    root = write_search(tmp_path / "results", strategy="random")
    trap = "from pathlib import Path\nPath(__file__).with_name('stolen').touch()\n"
    for name in ("mine.py", "boundary.py"):
        (root / "_config" / name).write_text(trap)
    path = root / "_config" / "limits.vast"
    path.write_text(path.read_text().replace("strategy: random", "strategy: mine.py:Mine"))
    search = found(root)
    assert (search.overview["built_in"], search.overview["shown"]) == (False, "")
    assert len(search.sets("speed", "load")["config"]) == 48
    with pytest.raises(InputError, match="provides no failure map"):
        search.map("speed", "load", {})
    assert not (root / "_config" / "stolen").exists()


def test_what_is_stored_later_is_seen_and_a_larger_budget_counts(tmp_path: Path) -> None:
    root = write_search(tmp_path / "results", strategy="random", batches=3)
    searches = Searches(Library(root.parent))
    assert searches.of(root.name).overview["ended"] is None
    assert searches.of(root.name) is searches.of(root.name)
    record = root / "_execution" / "execution.yaml"
    record.write_text(dump_yaml({**read_mapping(record), "batches": 3}))
    assert searches.of(root.name).overview["ended"].kind == "batches"


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ("strategy: 7", "`search.strategy`"),
        ("strategy: boundary\n  nonsense: 1", "`search.nonsense`"),
        ("strategy: boundary\n  seed: often", "`search.seed`"),
    ],
)
def test_a_damaged_document_is_named(tmp_path: Path, change: str, why: str) -> None:
    root = write_search(tmp_path / "results", batches=1)
    path = root / "_config" / "limits.vast"
    path.write_text(path.read_text().replace("strategy: boundary", change))
    with pytest.raises(InputError, match=rf"limits\.vast: .*{why}"):
        found(root).map("speed", "load", {})


def test_a_batch_that_leads_out_of_the_folder_is_not_read(tmp_path: Path) -> None:
    root = write_search(tmp_path / "results", strategy="random", batches=2)
    away = tmp_path / "away"
    (root / "_execution/search").rename(away)
    (root / "_execution/search").symlink_to(away)
    with pytest.raises(InputError, match="leads out"):
        found(root)


def test_a_search_whose_execution_is_not_recorded_is_shown(tmp_path: Path) -> None:
    root = write_search(tmp_path / "results", strategy="random", batches=2)
    (root / "_execution" / "execution.yaml").unlink()
    assert found(root).overview["batches"] == 2


@pytest.mark.parametrize(
    "at", ["[]", "{", '{"speed": 2}', '{"speed": NaN}', f'{{"x": 1{"0" * 400}}}']
)
def test_a_place_that_is_none_is_refused(tmp_path: Path, at: str) -> None:
    root = write_search(tmp_path / "results", batches=1)
    scope = {"type": "http", "path_params": {"campaign": root.name}}
    query = urlencode({"x": "speed", "y": "load", "at": at}).encode()
    with pytest.raises(InputError, match="is not a valid position in a search"):
        SearchPages(Library(root.parent)).map(Request(scope | {"query_string": query}))


def test_a_campaign_without_a_search(tmp_path: Path) -> None:
    root = write_campaign(tmp_path / "results", outputs=False)
    assert not is_search(root.parent, root.name)
    with pytest.raises(InputError, match=r"There is no hall-.*_execution/search"):
        found(root)


def test_ten_thousand_evaluations_are_small_and_soon_there(tmp_path: Path) -> None:
    root = write_search(
        tmp_path / "results", batches=20, runs=False, strategy="random", per_batch=500
    )
    begin = time.process_time()
    search = found(root)
    assert search.overview["evaluated"] == 10_000
    assert len(json.dumps(search.sets("speed", "load"))) < 700_000
    assert len(json.dumps(search.overview, default=vars)) < 20_000
    assert time.process_time() - begin < 20

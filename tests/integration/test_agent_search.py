"""Searches as pods of plain processes, with a real S3: propose, execute, propose again."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from robovast_testbed.s3 import Server
from support.campaigns.local import Recorder, make_campaign
from support.kube.pod_processes import Campaign, Pod

from robovast.execution.local import LocalOptions
from robovast.kubeapi.pod_contract.messages import LIMIT
from robovast.model.document import load_document
from robovast.model.packs import Block, Entry, PlanSpec, format_breaks
from robovast.search.local import execute_document
from robovast.search.results import StoredSearch
from robovast.storage.download import Silent, download_campaign

pytestmark = pytest.mark.parametrize("s3_server", ["minio"], indirect=True)

DOCUMENT = """\
version: 1
metadata: {name: test_search}
execution:
  scenario_file: scenario.osc
  run_files: ['files/*']
  seed: 3
search:
  search_space:
    x: {type: int, low: 0, high: 100}
"""
RANDOM = """\
  strategy: random
  objectives: [{name: failure_rate}]
  per_batch: 2
  budget: [{batches: 2}]
"""
FAILS_ABOVE_50 = 'echo "x,y" > "$3/out.csv"; echo "1,$1" >> "$3/out.csv"; [ "$1" -lt 50 ]\n'


class Search:
    """A search whose plan grows as the operator would let it grow."""

    def __init__(self, folder: Path, server: Server, extra: str, script: str) -> None:
        vast = make_campaign(folder / "source", script, extra, document=DOCUMENT)
        self.campaign = Campaign(folder / "mounts", vast, server, {"expansion": "proposed"})
        self.campaign.change(seed=3)
        self.root = folder

    def propose(self) -> dict[str, Any]:
        pod = Pod(self.campaign)
        assert pod.task("propose") == 0, pod.log("propose")
        assert len(pod.message_file.read_bytes()) <= LIMIT
        message: dict[str, Any] = pod.message()
        return message

    def append(self, said: dict[str, Any]) -> range:
        """Put what was proposed into the plan; returns the new packs."""
        before = self.campaign.plan.plan or PlanSpec(blocks=())
        known = self.campaign.plan.entries[0].variants if self.campaign.plan.entries else 0
        keys = ("first_variant", "variants", "first_run", "runs")
        more = [Block(**dict(zip(keys, block, strict=True))) for block in said["blocks"]]
        variants = known + said["variants"]
        plan = PlanSpec(blocks=(*before.blocks, *more), breaks=format_breaks(range(1, variants)))
        entries = (Entry(name="search", variants=variants),)
        self.campaign.change(plan=plan, entries=entries, composed=said["digest"])
        return range(before.packs, plan.packs)

    def go_on(self) -> dict[str, Any]:
        """Propose, and execute what is proposed, until the search ends."""
        while not (said := self.propose())["stop"]:
            for pack in self.append(said):
                Pod(self.campaign).run(pack)
        return said

    def download(self) -> Path:
        home = self.root / "home" / self.campaign.name
        download_campaign(self.campaign.store, self.campaign.bucket, home, Silent())
        return home


Make = Callable[..., Search]


@pytest.fixture
def make(tmp_path: Path, s3_server: Server) -> Iterator[Make]:
    made: list[Search] = []

    def make(extra: str = RANDOM, script: str = FAILS_ABOVE_50) -> Search:
        made.append(Search(tmp_path, s3_server, extra, script))
        return made[-1]

    yield make
    for search in made:
        search.campaign.close()


def proposed(campaign: Path) -> list[list[dict[str, Any]]]:
    files = sorted((campaign / "_execution/search").glob("batch-????.json"))
    return [[item["values"] for item in json.loads(file.read_text())["sets"]] for file in files]


def test_a_search_of_pods_proposes_and_finds_what_one_on_this_machine_does(
    make: Make, tmp_path: Path
) -> None:
    search = make()
    said = search.go_on()
    assert (said["batch"], said["evaluated"], said["stop"]) == (2, 4, "batches")
    assert said["criteria"] == "batches 2/2"
    assert Pod(search.campaign).task("finish") == 0
    home = search.download()
    document = load_document(search.campaign.vast)
    options = LocalOptions(runtime="process")
    local = execute_document(document, tmp_path / "local", options, Recorder()).campaign
    assert proposed(home) == proposed(local)
    assert StoredSearch(home).sets() == StoredSearch(local).sets()
    assert said["best"].startswith("failure_rate ")
    query = "SELECT config_name, objective, n_samples, status FROM unit ORDER BY id"
    with (
        sqlite3.connect(home / "campaign.db") as one,
        sqlite3.connect(local / "campaign.db") as two,
    ):
        assert one.execute(query).fetchall() == two.execute(query).fetchall()
    seeds = [
        {
            path.parent.relative_to(root).as_posix(): json.loads(path.read_text())["seed"]
            for path in root.glob("c*/*/run.json")
        }
        for root in (home, local)
    ]
    assert seeds[0] == seeds[1]
    assert (home / "_config/files/step.sh").is_file()

"""Searches as pods of plain processes, with a real S3: propose, execute, propose again."""

from __future__ import annotations

import json
import shutil
import sqlite3
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from robovast_testbed.s3 import Server
from support.campaigns import searched
from support.campaigns.local import Recorder, make_campaign
from support.campaigns.one_run import Execution, killed_after, open_store
from support.campaigns.searched import FAILS_ABOVE_50, at_random
from support.kube.pod_processes import Campaign, Pod
from support.optional import needs

from robovast.agent import propose as propose_module
from robovast.agent.bucket import Bucket
from robovast.agent.campaign import PodCampaign as AgentCampaign
from robovast.agent.composed import ComposedVariants
from robovast.agent.mounts import Folders
from robovast.base.errors import StorageError
from robovast.campaign.layout import Layout
from robovast.execution.local import LocalOptions
from robovast.kubeapi.pod_contract.messages import LIMIT
from robovast.model.document import load_document
from robovast.model.packs import Block, Entry, PlanSpec, format_breaks
from robovast.search.local import execute_document
from robovast.search.results import stored_search
from robovast.storage.download import Silent, download_campaign

needs("optuna")
pytestmark = pytest.mark.parametrize("s3_server", ["minio"], indirect=True)

DOCUMENT = searched.DOCUMENT.replace("search:", "  seed: 3\nsearch:")
RANDOM = at_random(2)


class Search:
    """A search whose plan grows as the operator would let it grow."""

    def __init__(
        self, folder: Path, server: Server, extra: str, script: str, files: Mapping[str, str]
    ) -> None:
        vast = make_campaign(folder / "source", script, extra, document=DOCUMENT)
        for name, text in files.items():
            (vast.parent / name).write_text(text)
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
        plan = PlanSpec(
            blocks=(*before.blocks, *more),
            breaks=format_breaks(range(1, variants)),
            awaited=said.get("awaited"),
        )
        entries = (Entry(name="search", variants=variants),)
        self.campaign.change(plan=plan, entries=entries, composed=said["digest"])
        return range(before.packs, plan.packs)

    def go_on(self) -> dict[str, Any]:
        """Propose, and execute no more than it waits for before it goes on, until it ends."""
        ended = 0
        while not (said := self.propose())["stop"]:
            self.append(said)
            awaited = self.awaited_packs
            for pack in range(ended, awaited):
                Pod(self.campaign).run(pack)
            ended = max(ended, awaited)
        return said

    @property
    def awaited_packs(self) -> int:
        """How many packs of the plan end before the search goes on."""
        plan = self.campaign.plan.plan
        assert plan is not None
        return PlanSpec(blocks=plan.awaited_blocks, breaks=plan.breaks).packs

    def download(self) -> Path:
        home = self.root / "home" / self.campaign.name
        download_campaign(self.campaign.store, self.campaign.bucket, home, Silent())
        return home


Make = Callable[..., Search]


@pytest.fixture
def make(tmp_path: Path, s3_server: Server) -> Iterator[Make]:
    made: list[Search] = []

    def make(
        extra: str = RANDOM, script: str = FAILS_ABOVE_50, files: Mapping[str, str] | None = None
    ) -> Search:
        folder = tmp_path / str(len(made))
        made.append(Search(folder, s3_server, extra, script, files or {}))
        return made[-1]

    yield make
    for search in made:
        search.campaign.close()


def proposed(campaign: Path) -> list[list[dict[str, Any]]]:
    files = sorted((campaign / "_execution/search").glob("batch-????.json"))
    return [[item["values"] for item in json.loads(file.read_text())["sets"]] for file in files]


def by(strategy: str, parameters: str, more: str = "") -> str:
    """Three batches of another strategy, whose third is proposed from what the first has found."""
    text = at_random(3).replace("random", strategy)
    return f"{text}  strategy_parameters: {parameters}\n{more}"


MEASURED = "  extract: {metrics: {y: {table: out, column: y, over_time: max, over_runs: mean}}}\n"


@pytest.mark.parametrize(
    ("extra", "batches"),
    [
        (at_random(4), 4),
        (by("optuna", "{n_startup_trials: 2}"), 3),
        (by("qd", "{archive: {measures: {y: {low: 0, high: 100, bins: 8}}}}", MEASURED), 3),
        (by("boundary", "{initial: 4}"), 3),  # two batches fill the space, side by side
    ],
    ids=["random", "optuna", "qd", "boundary"],
)
def test_a_search_of_pods_proposes_and_finds_what_one_on_this_machine_does(
    make: Make, tmp_path: Path, extra: str, batches: int
) -> None:
    search = make(extra)
    said = search.go_on()
    assert (said["batch"], said["evaluated"], said["stop"]) == (batches, 2 * batches, "batches")
    assert said["criteria"] == f"batches {batches}/{batches}"
    assert Pod(search.campaign).task("finish") == 0
    home = search.download()
    document = load_document(search.campaign.vast)
    options = LocalOptions(runtime="process")
    local = execute_document(document, tmp_path / "local", options, Recorder()).campaign
    assert proposed(home) == proposed(local)
    assert stored_search(home).sets() == stored_search(local).sets()
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


STEPS = """\
from robovast.search.strategy import HistoryStrategy
from robovast.search.types import ParamSet


class Steps(HistoryStrategy):
    \"\"\"Each batch begins where the evaluations of those before lead.\"\"\"

    def propose(self, n):
        begin = len(self.asked)
        begin += sum(known.n_samples * known.params.values["x"] for known in self.known.values())
        return [ParamSet({"x": (begin + 7 * i) % 101}, n_reps=1 + i % 2) for i in range(n)]
"""
BY_STEPS = "strategy: random", "strategy: steps.py:Steps"
FOLLOWING = RANDOM.replace(*BY_STEPS)


class Stages:
    """A search without pods: `propose` in this process, and runs that are only said to have run."""

    def __init__(self, search: Search, monkeypatch: pytest.MonkeyPatch) -> None:
        self.search = search
        self.campaign = search.campaign
        self.work = search.root / "work"
        self.work.mkdir()
        self.store = open_store(self.campaign.server)
        self._patch = monkeypatch

    def propose(self) -> None:
        root = self.campaign.root
        message = self.work / "message"
        message.write_text("")
        mounts = {name: root / name for name in ("plan", "files", "credentials")}
        folders = Folders(**mounts, work=self.work / "pod", message=message)
        shutil.rmtree(folders.work, ignore_errors=True)
        folders.work.mkdir()
        campaign = AgentCampaign(self.campaign.plan, folders, self.store)
        self._patch.setattr(propose_module, "open_campaign", lambda *_, **__: campaign)
        propose_module.propose(folders)

    @property
    def message(self) -> dict[str, Any]:
        text = (self.work / "message").read_text()
        assert len(text) <= LIMIT
        found: dict[str, Any] = json.loads(text)
        return found

    def killed(self, step: int) -> int:
        """Propose, killed after ever more requests until none is left; returns how often."""
        number = 0
        while killed_after(self.store, number * step, self.propose):
            number += 1
        return number

    def store_runs(self, packs: range, *, lost: int | None = None) -> None:
        """Store the runs of some packs, but for those of one variant."""
        plan = self.campaign.plan
        assert plan.plan is not None
        assert plan.composed is not None
        bucket = Bucket(self.store, plan.bucket, plan.owner)
        layout = Layout(self.work / "nowhere")
        variants = ComposedVariants(bucket, layout, plan.composed, growing=True)
        for pack in packs:
            for id_ in plan.plan.pack(pack):
                variant, number = plan.plan.run(id_)
                if variant != lost:
                    run = f"{variants[variant].name}/{number}"
                    Execution(self.campaign.server, plan.bucket, run, "done").storing()


@pytest.fixture
def stages(make: Make, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Stages]:
    def made(extra: str = FOLLOWING) -> Stages:
        return Stages(make(extra, files={"steps.py": STEPS}), monkeypatch)

    return made


def test_pods_that_propose_may_be_killed_after_any_request(
    stages: Callable[..., Stages],
) -> None:
    four = at_random(4).replace(*BY_STEPS)  # after the first, the others are proposed at once
    calm, hunted = stages(four), stages(four)
    kills = ended = 0
    while True:
        calm.propose()
        kills += hunted.killed(3)
        assert hunted.message == calm.message
        if calm.message["stop"]:
            break
        for each in (calm, hunted):
            each.search.append(each.message)
            each.store_runs(range(ended, each.search.awaited_packs))
        ended = calm.search.awaited_packs
    assert (calm.message["stop"], calm.message["evaluated"]) == ("batches", 8)
    assert kills > 25
    assert proposed(hunted.search.download()) == proposed(calm.search.download())
    found, wanted = (stored_search(one.search.download()).sets() for one in (hunted, calm))
    assert found == wanted


def test_of_two_pods_that_propose_at_once_the_slower_one_gives_up(
    stages: Callable[..., Stages],
) -> None:
    search = stages()
    keep = propose_module._keep

    def late(bucket: Bucket, layout: Layout, path: Path, text: str) -> None:
        key = path.relative_to(layout.root).as_posix()
        bucket.store.put_bytes(bucket.name, key, text.replace('"told": 0', '"told": 1').encode())
        keep(bucket, layout, path, text)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(propose_module, "_keep", late)
        with pytest.raises(StorageError, match="another pod stored this object first"):
            search.propose()
    search.propose()
    assert search.message["blocks"], "the next one goes on with what the faster one has stored"
    (told,) = (search.search.download() / "_execution/search").glob("*.json")
    assert json.loads(told.read_text())["told"] == 1


def test_a_set_without_a_verdict_is_run_once_more_and_then_left_out(
    stages: Callable[..., Stages],
) -> None:
    search = stages()
    search.propose()
    search.store_runs(search.search.append(search.message), lost=0)
    search.propose()
    again = search.message
    assert (again["blocks"], again["variants"], again["batch"]) == ([[0, 1, 1, 1]], 0, 0)
    search.store_runs(search.search.append(again), lost=0)
    search.propose()
    assert (search.message["batch"], search.message["evaluated"]) == (1, 1)
    assert search.message["blocks"][0][0] == 2, "the next batch"
    home = search.search.download()
    with sqlite3.connect(home / "campaign.db") as store:
        found = store.execute("SELECT status FROM unit ORDER BY id").fetchall()
    assert found == [("errored",), ("evaluated",)]


def test_runs_that_no_message_can_name_are_proposed_in_parts(
    stages: Callable[..., Stages],
) -> None:
    search = stages(FOLLOWING.replace("per_batch: 2", "per_batch: 101"))
    search.propose()
    first = search.message
    assert (len(first["blocks"]), first["variants"]) == (100, 101)
    search.search.append(first)
    search.propose()
    rest = search.message
    assert (rest["blocks"], rest["variants"], rest["batch"]) == ([[100, 1, 0, 1]], 0, 0)
    assert rest["digest"] == first["digest"]


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("steps.py:Steps", "steps.py:Stepps", "Stepps"),
        ("steps.py:Steps", "stepts.py:Steps", "no plugin file"),
        ("name: failure_rate", "name: failure_rat", "Did you mean `failure_rate`?"),
        ("per_batch: 2", "per_batch: 2\n  parameters: [{text: $y}]", "names no dimension"),
        (
            "per_batch: 2",
            "per_batch: 2\n  variations:\n  - ParameterVariationList: {name: text, values: [a, b]}",
            "create 2 configurations",
        ),
    ],
)
def test_what_is_wrong_is_said_before_anything_runs(
    make: Make, old: str, new: str, why: str
) -> None:
    search = make(RANDOM, files={"steps.py": STEPS})
    text = search.campaign.vast.read_text().replace("strategy: random", "strategy: steps.py:Steps")
    (search.campaign.root / "plan/document.vast").write_text(text.replace(old, new))
    pod = Pod(search.campaign)
    assert pod.task("propose") == 65, pod.log("propose")
    assert why in pod.message()["error"]

"""The page on a campaign that stays in its bucket, of a real S3 server, in a real browser."""

from __future__ import annotations

import random
import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote
from uuid import uuid4

import pytest
from playwright.sync_api import expect, sync_playwright
from robovast_testbed import debian
from robovast_testbed.s3 import Server
from support.campaigns.one_run import open_store
from support.campaigns.stored import NAME, write_campaign
from support.patience import PATIENCE
from support.servers.cutting_proxy import CuttingProxy, cutting_proxy
from support.servers.page import VAST, shown

from robovast.agent.bucket import Bucket
from robovast.agent.untrusted_files import store_own_tree
from robovast.analysis.tables.columnar import write_runs
from robovast.analysis.tables.runs import record_rows
from robovast.campaign.layout import RUNS_TABLE, Layout
from robovast.campaign.run_record import read_run_record
from robovast.evaluation.bucket_library import BucketLibrary, StoredCampaign
from robovast.model.packs import Owner
from robovast.storage.s3 import ObjectStore

pytestmark = pytest.mark.parametrize("s3_server", ["versitygw"], indirect=True)

RECORDING = 300_000
"""Size of what each run has recorded [bytes]."""
VARIANTS = [{"speed": place % 5, "width": place // 5} for place in range(20)]
SHARE = 0.15
"""Of the bucket's bytes that may be fetched to see the campaign and two runs of 40."""


@dataclass(frozen=True)
class Place:
    store: ObjectStore
    bucket: str
    proxy: CuttingProxy

    @property
    def size(self) -> int:
        return sum(item.size for item in self.store.objects(self.bucket))


def judge(parameters, number) -> str:
    return "failed" if parameters["speed"] == 4 and number == 1 else "passed"


@pytest.fixture(scope="module")
def place(s3_server: Server, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    """A campaign of 40 runs in a bucket with an owner, and its runs as a table."""
    root = write_campaign(tmp_path_factory.mktemp("made"), variants=VARIANTS, runs=2, judge=judge)
    chance = random.Random(1)  # noqa: S311  # no secret
    folders = list(Layout(root).run_folders())
    for folder in folders:
        (folder / "recording.bin").write_bytes(chance.randbytes(RECORDING))
    records = [record for folder in folders if (record := read_run_record(folder))]
    write_runs(root / RUNS_TABLE, list(record_rows(records)))
    store, uid = open_store(s3_server), str(uuid4())
    name = f"test-{uuid4().hex[:12]}"
    bucket = Bucket(store, name, Owner(uid=uid, namespace="here", name="hall", campaign=NAME))
    bucket.claim()
    store_own_tree(bucket, root)
    with cutting_proxy(s3_server.endpoint) as proxy, pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("ROBOVAST_S3_ENDPOINT", f"http://{proxy.address}")
        monkeypatch.setenv("ROBOVAST_S3_ACCESS_KEY", s3_server.access_key)
        monkeypatch.setenv("ROBOVAST_S3_SECRET_KEY", s3_server.secret_key)
        yield Place(store, name, proxy)
    store.delete_bucket(name)


def test_the_page_fetches_what_is_looked_at(place: Place) -> None:
    debian.require("chromium")
    with sync_playwright() as playwright, shown(None, "--bucket", place.bucket) as server:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox"]
        )
        page = browser.new_page()
        page.set_default_timeout(1000 * PATIENCE)
        expect.set_options(timeout=1000 * PATIENCE)
        page.goto(f"{server.address}#/campaign/{NAME}?x=speed&y=width")
        expect(page.locator("[data-cell]")).to_have_count(20)
        failures = page.get_by_role("region", name="Causes of unsuccessful runs")
        expect(failures).to_contain_text("goal not reached: no goal after 20 s")
        page.locator("tr[data-row]").first.get_by_role("link").click()
        expect(page.get_by_role("heading", level=1)).to_have_text(re.compile("hall-5/1 .*failed"))
        lines = page.get_by_role("region", name="Lines of the log")
        expect(lines).to_contain_text("goal not reached")
        page.goto("about:blank")  # it leaves before the server does
        browser.close()
        other = server.get(f"api/campaigns/{NAME}/hall-7/1").data["details"]
        path = f"{NAME}/hall-7/1/recording.bin"
        assert path in [entry["path"] for entry in other["files"]]
        assert len(server.get(f"files/{path}").body) == RECORDING
        refused = server.get(f"api/campaigns/{NAME}/logs?text=goal&run=hall-1/0")
        assert "vast results download" in refused.data["error"]
    assert RECORDING < place.proxy.received < SHARE * place.size


def test_what_is_kept_of_runs_is_bounded_and_comes_again(place: Place, tmp_path: Path) -> None:
    folder = tmp_path / "page"
    campaign = StoredCampaign(place.store, place.bucket, NAME, tmp_path)
    library = BucketLibrary(campaign, folder, most=3 * RECORDING)
    for number in (1, 2, 3, 4, 1):
        run = folder / NAME / f"hall-{number}" / "0"
        library.bring(f"{NAME}/hall-{number}/0/recording.bin")
        assert (run / "recording.bin").stat().st_size == RECORDING
        assert (run / "job" / "logs" / "system.log").is_file()
        here = list(folder.glob("*/*/*/recording.bin"))
        assert len(here) <= 2, here
    log = folder / NAME / "_jobs" / "job-2" / "logs" / "system.log"  # of hall-2/0, long ago
    assert not log.exists()
    library.bring(log.relative_to(folder).as_posix())
    assert log.is_file()
    outside = tmp_path / "outside"
    outside.touch()
    for path in (f"{NAME}/_jobs/../../../x", f"{NAME}/../0/x", f"{NAME}/..", "other/hall-1/0"):
        library.bring(path)
    assert outside.exists()
    assert (folder / NAME / "_execution").is_dir()


def test_what_is_wrong_is_one_sentence(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    shown_bucket = ("--bucket", place.bucket)
    table = place.store.read(place.bucket, RUNS_TABLE)
    assert table is not None
    place.store.delete(place.bucket, [RUNS_TABLE])
    assert "They are created when all runs have finished" in refusal(*shown_bucket)
    place.store.put_bytes(place.bucket, RUNS_TABLE, table)
    assert "has no bucket of a campaign `none-such`" in refusal("--bucket", "none-such")
    assert "exclude each other" in refusal(*shown_bucket, "-r", "results")
    monkeypatch.setenv("ROBOVAST_S3_SECRET_KEY", quote("another key"))
    assert "cannot list buckets" in refusal(*shown_bucket)


def refusal(*options: str) -> str:
    """What `vast evaluation gui` complains about."""
    command = [VAST, "evaluation", "gui", "--no-browser", *options]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert ended.returncode not in (0, 1), ended
    assert ended.stderr.count("error: ") == 1, ended.stderr
    assert "Traceback" not in ended.stderr
    return ended.stderr

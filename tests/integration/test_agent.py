"""Pods of a campaign, each as plain processes: the real scripts, real scenarios, a real S3."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import random
import re
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
import yaml
from robovast_testbed.s3 import Server
from support.campaigns.local import (
    AS_NEEDED,
    DECISIONS,
    DOCUMENT,
    SOUND_BROKEN_MIXED,
    Recorder,
    make_campaign,
    run,
    verdicts,
)
from support.kube.pod_processes import Campaign, Pod, keys_by_path, pids_of
from support.patience import PATIENCE, eventually
from support.servers.refusing_s3_proxy import refusing

from robovast.agent import reuse
from robovast.agent.claims import MOST_STARTS
from robovast.analysis.tables.in_bucket import tables_in
from robovast.analysis.tables.query import ask
from robovast.base import safe_paths
from robovast.campaign.configurations import variants_digest
from robovast.campaign.layout import INDEX, INPUTS, RUNS_TABLE
from robovast.execution.local import LocalOptions, replay_run
from robovast.execution.local.replay import find_run
from robovast.kubeapi.pod_contract.pod_facts import Sightings
from robovast.model.document import load_document
from robovast.model.expansion import Variant, compose
from robovast.model.packs import Block, PlanSpec
from robovast.model.plan import Run
from robovast.model.repetition import GroupSizes, list_key, list_name
from robovast.model.seeds import run_seed
from robovast.storage.bucket_names import REUSE_BUCKET
from robovast.storage.download import Silent, download_campaign

PASS = 'echo "$1,$2" > "$3/out.csv"\n'
FAIL_SECOND = PASS + '[ "$1" != 2 ]\n'
PACK = "  runs_per_job: 3\n"

Make = Callable[..., Campaign]

one_server = pytest.mark.parametrize("s3_server", ["minio"], indirect=True)
"""For what does not depend on the make of the server."""


@pytest.fixture
def make(tmp_path: Path, s3_server: Server) -> Iterator[Make]:
    """Makes a campaign; its variants are one-1, one-2 and one-3."""
    made: list[Campaign] = []

    def make(
        script: str,
        extra: str = "",
        files: Mapping[str, str] | None = None,
        document: str = DOCUMENT,
        **given: object,
    ) -> Campaign:
        extra = extra.replace("MOUNTS", str(tmp_path / "mounts"))
        vast = make_campaign(tmp_path / f"source{len(made)}", script, extra, document)
        for name, text in (files or {}).items():
            (vast.parent / name).write_text(text)
        made.append(Campaign(tmp_path / f"mounts{len(made) or ''}", vast, s3_server, dict(given)))
        return made[-1]

    yield make
    for campaign in made:
        campaign.close()


@contextlib.contextmanager
def small_disk(folder: Path) -> Iterator[None]:
    """A file system of 8 MiB in place of a folder that has a termination message alone."""
    mount = ["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", folder]
    if subprocess.run(mount, check=False, capture_output=True).returncode:
        pytest.skip("this user cannot mount file systems")
    try:
        (folder / "termination-log").touch()
        yield
    finally:
        subprocess.run(["umount", "--lazy", folder], check=True)


def files_below(root: Path) -> set[str]:
    """The files of a local campaign, relative to it."""
    found = (path for path in root.rglob("*") if path.is_file() and not path.is_symlink())
    return {path.relative_to(root).as_posix() for path in found}


def stored(campaign: Campaign, variant: str) -> list[str]:
    return [run for run in campaign.verdicts() if run.startswith(f"{variant}/")]


@one_server
@pytest.mark.parametrize("per_job", [1, 3])
def test_a_pod_executes_as_many_runs_of_its_configuration_as_a_laptop_does(
    make: Make, tmp_path: Path, per_job: int
) -> None:
    extra = f"{AS_NEEDED}  seed: 7\n  runs_per_job: {per_job}\n"
    campaign = make(SOUND_BROKEN_MIXED, extra, seed=7)
    pods = [Pod(campaign) for _ in range(3)]
    assert [pod.run(index) for index, pod in enumerate(pods)] == [0, 10, 10]
    assert [pod.message()["counts"] for pod in pods] == [[3, 0, 0], [0, 2, 0], [2, 2, 0]]
    assert [pod.message().get("notNeeded") for pod in pods] == [1, 2, None]
    here = run(campaign.vast, tmp_path / "here", jobs=1)
    assert campaign.verdicts() == verdicts(here)
    assert {path: campaign.record(path)["seed"] for path in verdicts(here)} == {
        f"{record.variant}/{record.run}": record.seed for record in here.records
    }
    finish = Pod(campaign)
    assert finish.task("finish") == 0, finish.log("finish")
    said = finish.message()
    assert (said["total"], said["notNeeded"], said["errored"]) == (12, 3, 0)
    assert said["decisions"] == DECISIONS
    index = json.loads(campaign.read("_execution/index.json"))
    assert len(index["runs"]) == 9
    assert {n: (d["state"], d["runs"]) for n, d in index["decisions"].items()} == {
        "one-1": ("sound", 3),
        "one-2": ("broken", 2),
        "one-3": ("undecided", 4),
    }


@one_server
def test_killed_in_the_middle_a_pod_is_followed_by_one_that_decides_the_same(make: Make) -> None:
    campaign = make(SOUND_BROKEN_MIXED, AS_NEEDED)
    for index, least in ((0, 1), (2, 3)):
        pod = Pod(campaign)
        pod.start(index)
        eventually(lambda n=index, least=least: len(stored(campaign, f"one-{n + 1}")) >= least)
        pod.kill()
    pods = [Pod(campaign) for _ in range(3)]
    assert [pod.run(index) for index, pod in enumerate(pods)] == [0, 10, 10]
    assert [pod.message()["counts"] for pod in pods] == [[3, 0, 0], [0, 2, 0], [2, 2, 0]]
    assert len(campaign.verdicts()) == 9


REUSED = {"image": f"registry/image@sha256:{'0' * 64}", "seed": 7, "reuse": True}
SEED = "  seed: 7\n  resources: {cpu: 1, memory: 1G}\n"


@one_server
@pytest.mark.parametrize("per_job", [1, 3])
def test_what_was_edited_alone_is_executed_and_the_others_are_taken_over(
    make: Make, per_job: int
) -> None:
    extra = f"{SEED}  runs: 2\n  runs_per_job: {per_job}\n"
    script = """echo "$1,$ROBOVAST_SEED" > "$3/out.csv"
mkdir "$3/d"; date +%N > "$3/d/when"
[ $1 != 2 ]
"""
    campaign = make(script, extra, **REUSED)
    packs = range(campaign.plan.plan.packs)
    ends = [Pod(campaign).run(index) for index in packs]
    edited = DOCUMENT.replace("[1, 2, 3]", "[1, 2, 4]")
    again = make(script, extra, document=edited, **REUSED)
    pods = [Pod(again) for _ in packs]
    assert [pod.run(index) for index, pod in enumerate(pods)] == ends
    origins = {name: again.record(name).get("reused_from", "") for name in again.verdicts()}
    reused = [n for n in origins if per_job == 1 or n in {"one-1/0", "one-1/1", "one-2/0"}]
    assert origins == {
        n: f"{campaign.name}/{n}" if n in reused and not n.startswith("one-3") else ""
        for n in origins
    }
    for name in ("one-1/0", "one-2/0"):
        before, now = campaign.record(name), again.record(name)
        assert (now["campaign"], now["id"], now["pod"]) == (again.name, before["id"], before["pod"])
        assert now["verdict"] == before["verdict"]
        for path in ("out.csv", "d/when", "test.xml"):
            assert again.read(f"{name}/{path}") == campaign.read(f"{name}/{path}")
        assert again.read(f"_jobs/{now['job']}/logs/system.log")
    assert again.read("one-3/0/out.csv").startswith("4,")
    finish = Pod(again)
    assert finish.task("finish") == 0, finish.log("finish")
    assert finish.message()["total"] == 6


@one_server
def test_runs_as_needed_are_taken_over_as_far_as_they_are_stored(make: Make) -> None:
    campaign = make(SOUND_BROKEN_MIXED, SEED + AS_NEEDED, **REUSED)
    assert [Pod(campaign).run(index) for index in range(3)] == [0, 10, 10]
    wider = AS_NEEDED.replace("max: 4", "max: 5")
    again = make(SOUND_BROKEN_MIXED, SEED + wider, **REUSED)
    assert [Pod(again).run(index) for index in range(3)] == [0, 10, 10]
    executed = [n for n in again.verdicts() if "reused_from" not in again.record(n)]
    assert executed == ["one-3/4"]


@one_server
def test_what_is_no_longer_what_it_was_is_executed(make: Make) -> None:
    extra = f"{SEED}  runs: 2\n"
    campaign = make("[ $1 != 2 ]\n", extra, **REUSED)
    ends = [0, 0, 10, 10, 0, 0]
    assert [Pod(campaign).run(index) for index in range(6)] == ends
    store, bucket = campaign.store, campaign.bucket
    keys = keys_by_path(store, bucket)
    store.put_bytes(bucket, keys["one-1/0/test.xml"], b"<testsuite/>")
    store.put_bytes(REUSE_BUCKET, campaign.record("one-3/0")["key"], b"nothing")
    for name, change in (
        ("one-1/1", {"verdict": "errored"}),
        ("one-2/0", {"verdict": "passed"}),
        ("one-2/1", {"outputs": {"../../../x": "0" * 64}}),
    ):
        text = json.dumps({**campaign.record(name), **change})
        store.put_bytes(bucket, f"{name}/run.json", text.encode())
    again = make("[ $1 != 2 ]\n", extra, **REUSED)
    assert [Pod(again).run(index) for index in range(6)] == ends
    assert [n for n in again.verdicts() if "reused_from" in again.record(n)] == ["one-3/1"]


@one_server
def test_whatever_others_have_stored_a_pod_executes_its_runs(make: Make) -> None:
    deep = f"[ $1 != 1 ] || for i in $(seq 20); do mkdir {'d' * 250}; cd {'d' * 250}; done\n"
    script = f'cd "$3"\n{deep}echo > f\n'
    extra = f"{SEED}  runs: 2\n"
    campaign = make(script, extra, **REUSED)
    assert [Pod(campaign).run(index) for index in range(6)] == [0] * 6
    store, bucket = campaign.store, campaign.bucket
    for name, offer in (
        ("one-2/0", {"bucket": "../x", "run": "one-2/0"}),
        ("one-2/1", {"bucket": bucket, "run": "../../x/0"}),
        ("one-3/0", {"bucket": bucket, "run": "one-3/0", "x": "x" * 100_000}),
    ):
        store.put_bytes(REUSE_BUCKET, campaign.record(name)["key"], json.dumps(offer).encode())
    text = json.dumps({**campaign.record("one-3/1"), "job": "\udc80"})
    store.put_bytes(bucket, "one-3/1/run.json", text.encode())
    again = make(script, extra, **REUSED)
    pods = [Pod(again) for _ in range(6)]
    assert [pod.run(index) for index, pod in enumerate(pods)] == [0] * 6, pods[0].log("agent")
    assert not [n for n in again.verdicts() if "reused_from" in again.record(n)]


@one_server
def test_of_a_pack_the_runs_before_the_first_that_is_damaged_are_taken_over(make: Make) -> None:
    campaign = make(PASS, SEED + PACK, **REUSED)
    assert Pod(campaign).run() == 0
    damage(campaign, keys_by_path(campaign.store, campaign.bucket)["one-2/0/out.csv"])
    again = make(PASS, SEED + PACK, **REUSED)
    pod = Pod(again)
    assert pod.run() == 0, pod.log("agent")
    origins = {n: again.record(n).get("reused_from") for n in again.verdicts()}
    assert origins == {"one-1/0": f"{campaign.name}/one-1/0", "one-2/0": None, "one-3/0": None}
    assert "one-2/0 is not reused" in pod.log("agent")
    assert not list(pod.work.rglob("reused"))


@one_server
def test_a_damaged_log_of_another_campaign_is_not_waited_for(make: Make) -> None:
    campaign = make(PASS, SEED, **REUSED)
    assert Pod(campaign).run() == 0
    damage(campaign, f"_jobs/{campaign.record('one-1/0')['job']}/logs/system.log")
    again = make(PASS, SEED, **REUSED)
    pod = Pod(again)
    assert pod.run() == 0, pod.log("agent")
    assert "reused_from" not in again.record("one-1/0")


@one_server
def test_a_campaign_that_is_removed_while_a_run_of_it_is_copied_is_not_waited_for(
    make: Make, tmp_path: Path
) -> None:
    campaign = make(PASS, SEED, **REUSED)
    assert Pod(campaign).run() == 0
    store = campaign.store
    found = reuse._find(store, campaign.record("one-1/0")["key"])
    assert found is not None
    run = Run(0, Variant("one-1", "one", {}), 0)

    def bring() -> bool:
        stage = tmp_path / "stage"
        safe_paths.remove(stage, tmp_path)
        return reuse._bring(store, found, stage, with_job=True)

    assert reuse._if_fit(store, run, campaign.bucket, bring) is True
    store.delete_bucket(campaign.bucket)
    assert reuse._if_fit(store, run, campaign.bucket, bring) is None


def damage(campaign: Campaign, key: str) -> None:
    """Replace an object's content, but not its checksum."""
    store, bucket = campaign.store, campaign.bucket
    metadata = {"sha256": store.digest(bucket, key) or ""}
    store._client.put_object(bucket, key, io.BytesIO(b"0,b\n"), 4, metadata=metadata)


@one_server
def test_a_repetition_goes_on_with_the_test(make: Make, tmp_path: Path) -> None:
    """What failed for a reason outside passes now, so that its configuration needs more runs."""
    broken = tmp_path / "broken"
    campaign = make(f"[ ! -e {broken} ] || [ $1 != 2 ]\n", AS_NEEDED)
    broken.touch()
    assert [Pod(campaign).run(index) for index in range(3)] == [0, 10, 0]
    broken.unlink()
    for attempt, stored_then in ((2, 8), (3, 9)):
        finish = Pod(campaign)
        assert finish.task("finish") == 0, finish.log("finish")
        repeat = finish.message()["repeat"]
        groups = GroupSizes.parse(repeat["sizes"]).groups
        asked = ("--attempt", attempt, "--repeat", repeat["list"])
        assert [Pod(campaign).run(index, *asked) for index in range(groups)] == [0] * groups
        assert len(campaign.verdicts()) == stored_then
    finish = Pod(campaign)
    assert finish.task("finish") == 0
    assert finish.message()["decisions"] == "3 passing after 3; 9 of 12 runs needed"


@one_server
def test_a_pack_is_one_pod(make: Make) -> None:
    campaign = make(FAIL_SECOND, PACK)
    pod = Pod(campaign)
    begin = time.monotonic()
    assert pod.run() == 10, pod.log("agent")
    lived = time.monotonic() - begin
    assert pod.message() == {"passed": "0,2", "failed": "1", "errored": "", "counts": [2, 1, 0]}
    assert campaign.verdicts() == {"one-1/0": "passed", "one-2/0": "failed", "one-3/0": "passed"}
    assert pod.bad() == {"one-2/0": f"failed: {campaign.record('one-2/0')['reason']}"}
    runs, seconds = pod.took()
    assert runs == 3
    assert 0 < seconds <= lived
    assert campaign.read("one-3/0/out.csv") == "3,a\n"
    assert campaign.read("_transient/job-0.params.yaml").count("_output_dir") == 3


@one_server
@pytest.mark.parametrize("expansion", ["pure", "composed"])
def test_runs_have_the_seeds_that_they_have_elsewhere(make: Make, expansion: str) -> None:
    """Also in a later job of the pack; the one with the run that is left knows its seed alone."""
    script = 'echo "$ROBOVAST_SEED" > "$3/out.csv"\n[ "$1" != 2 ] || kill -9 $PPID\n'
    campaign = make(script, PACK, seed=7, expansion=expansion)
    if expansion == "composed":
        composing = Pod(campaign)
        assert composing.task("compose") == 0
        campaign.change(composed=composing.message()["digest"])
    assert Pod(campaign).run() == 11
    for variant in ("one-1", "one-2", "one-3"):
        seed = run_seed(7, variant, 0)
        assert campaign.record(f"{variant}/0")["seed"] == seed
        assert campaign.read(f"{variant}/0/out.csv") == f"{seed}\n"
    assert Pod(campaign).task("finish") == 0
    assert yaml.safe_load(campaign.read("_execution/execution.yaml"))["seed"] == 7


@one_server
def test_one_run_comes_home_with_all_that_its_replay_needs(make: Make, tmp_path: Path) -> None:
    script = 'echo "$1 $ROBOVAST_SEED" > "$3/out.csv"\n'
    campaign = make(script, PACK, seed=7)
    assert Pod(campaign).run() == 0
    assert Pod(campaign).task("finish") == 0
    home = tmp_path / "home" / campaign.name
    download_campaign(campaign.store, campaign.bucket, home, Silent(), run="one-2/0")
    assert {path.name for path in home.iterdir()} >= {"_config", "_transient", "one-2"}
    assert not (home / "one-1").exists()
    stored = find_run(home / "one-2" / "0")
    options = LocalOptions(runtime="process")
    summary = replay_run(stored, tmp_path / "replays", 1, options, Recorder())
    again = (summary.campaign / "one-2/0/out.csv").read_text()
    assert again == campaign.read("one-2/0/out.csv") == f"2 {run_seed(7, 'one-2', 0)}\n"


@one_server
def test_a_run_that_kills_its_process_is_errored_and_the_others_go_on(make: Make) -> None:
    campaign = make(PASS + 'if [ "$1" = 2 ]; then kill -9 $PPID; fi\n', PACK)
    pod = Pod(campaign)
    assert pod.run() == 11, pod.log("agent")
    assert pod.message() == {"passed": "0,2", "failed": "", "errored": "1", "counts": [2, 0, 1]}
    assert campaign.read("one-2/0/out.csv") == "2,a\n", "partial output is kept"
    reason = campaign.record("one-2/0")["reason"]
    assert "SIGKILL" in reason
    assert pod.bad() == {"one-2/0": f"errored: {reason}"}
    jobs = [campaign.record(f"one-{n}/0")["job"] for n in (1, 2, 3)]
    assert jobs == ["job-0", "job-0", "job-0-2"]
    assert "_jobs/job-0/logs/system.log" in campaign.objects()
    assert "_jobs/job-0-2/logs/system.log" in campaign.objects()


@one_server
def test_a_timeout_costs_one_run(make: Make) -> None:
    campaign = make(PASS + '[ "$1" != 2 ] || sleep 600\n', PACK + "  timeout: 20\n")
    assert Pod(campaign).run() == 11
    assert campaign.verdicts() == {"one-1/0": "passed", "one-2/0": "errored", "one-3/0": "passed"}
    assert "execution.timeout" in campaign.record("one-2/0")["reason"]


@one_server
def test_runs_with_a_secondary_container(make: Make) -> None:
    script = 'if [[ $CONTAINER_NAME ]]; then echo "$CONTAINER_NAME is up"; exec sleep 600; fi\n'
    extra = "  secondary_containers: [nav]\n  pre_command: /config/files/pre.sh\n" + PACK
    seen = 'until grep -q sleep "$OUTPUT_DIR/resource_usage_nav.csv"; do sleep 0.1; done'
    step = f'sleep 0.5; {seen}\n[ "$1" != 2 ] || kill -9 $PPID\n'
    campaign = make(step, extra, files={"files/pre.sh": script})
    assert Pod(campaign).run(secondaries=("nav",)) == 11
    for job in ("job-0", "job-0-2"):
        assert "nav is up" in campaign.read(f"_jobs/{job}/logs/system_nav.log")
        assert "sleep" in campaign.read(f"_jobs/{job}/resource_usage_nav.csv")


@one_server
def test_a_container_that_is_killed_costs_one_run(make: Make) -> None:
    """As the kernel does it when memory runs out."""
    campaign = make(PASS + '[ "$1" != 2 ] || touch here; [ "$1" != 2 ] || sleep 600\n', PACK)
    pod = Pod(campaign)
    container, agent = pod.start()
    eventually(lambda: (pod.out / "one-2/0/out.csv").exists())
    pod.kill(container)
    assert agent.wait(PATIENCE) == 75
    assert pod.message() == {"passed": "0", "failed": "", "errored": "1", "counts": [1, 0, 1]}
    assert "SIGKILL" in campaign.record("one-2/0")["reason"]
    assert campaign.read("one-2/0/out.csv") == "2,a\n"
    assert "Executing scenario" in campaign.read("_jobs/job-0/logs/system.log")
    later = Pod(campaign)
    assert later.run() == 11
    assert later.message() == {"passed": "0,2", "failed": "", "errored": "1", "counts": [2, 0, 1]}
    assert campaign.record("one-3/0")["job"] == "job-0-2"


@one_server
def test_what_kubernetes_alone_knows_of_pods_is_in_the_records_of_the_runs_that_they_executed(
    make: Make,
) -> None:
    """Image and lack of memory, as the operator hands them to `finish`; nothing of other pods."""
    campaign = make(PASS + '[ "$1" != 2 ] || touch here; [ "$1" != 2 ] || sleep 600\n', PACK)
    pod = Pod(campaign)
    container, agent = pod.start()
    eventually(lambda: (pod.out / "one-2/0/out.csv").exists())
    pod.kill(container)
    agent.wait(PATIENCE)
    later = Pod(campaign)
    assert later.run() == 11
    assert campaign.record("one-1/0")["image_digest"] == ""
    folder = campaign.root / "pods"
    folder.mkdir()
    image = "registry/image@sha256:" + "5" * 64
    seen = Sightings({pod.name: image}, frozenset({pod.name, later.name}))
    (folder / "of-a-job").write_text(seen.dump())
    (folder / "no-sense").write_bytes(b"\xff{")
    task = Pod(campaign)
    assert task.task("finish") == 0, task.log("finish")
    digests = {run: campaign.record(run)["image_digest"] for run in campaign.verdicts()}
    assert digests == {"one-1/0": image, "one-2/0": image, "one-3/0": ""}
    assert "SIGKILL: out of memory" in campaign.record("one-2/0")["reason"]
    assert campaign.record("one-3/0")["verdict"] == "passed"
    index = json.loads(campaign.read("_execution/index.json"))["runs"]
    assert "SIGKILL: out of memory" in index[1]["reason"]
    assert campaign.read("one-2/0/out.csv") == "2,a\n"


@one_server
def test_a_pod_that_is_told_to_end_keeps_what_is_over(make: Make) -> None:
    campaign = make(PASS + '[ "$1" != 2 ] || sleep 600\n', PACK)
    pod = Pod(campaign)
    container, agent = pod.start()
    eventually(lambda: (pod.out / "one-2/0/out.csv").exists())
    container.terminate()  # first, as it may happen: its run then writes a verdict
    agent.terminate()
    assert (agent.wait(PATIENCE), container.wait(PATIENCE)) == (75, 0)
    assert campaign.verdicts() == {"one-1/0": "passed"}
    assert pod.message() == {"passed": "0", "failed": "", "errored": "", "counts": [1, 0, 0]}


def executing(
    campaign: Campaign, silence: int
) -> tuple[Pod, subprocess.Popen[bytes], subprocess.Popen[bytes]]:
    """A pod that executes a run, its agent, which may be silent for so long [s], and the run's."""
    pod = Pod(campaign)
    agent = pod.command("agent")
    eventually(pod.script.exists)
    script = pod.script.read_text()
    assert "silence=120" in script
    pod.script.write_text(script.replace("silence=120", f"silence={silence}"))
    container = pod.start_run()
    eventually(lambda: "Executing scenario" in pod.log("start"))
    return pod, agent, container


@one_server
def test_a_container_ends_with_its_agent(make: Make) -> None:
    campaign = make("sleep 600\n")
    pod, agent, container = executing(campaign, silence=30)
    heartbeat = pod.work / "config/.robovast/heartbeat"
    before = heartbeat.read_text()
    eventually(lambda: heartbeat.read_text() != before)
    pod.kill(agent)
    assert container.wait(58) == 0  # not a second silence after the run's end


@one_server
def test_a_run_whose_agent_was_silent_for_too_long_has_no_verdict(make: Make) -> None:
    """The agent was held up, as by a disk that hangs, and goes on: its run was ended by us."""
    campaign = make("sleep 600\n")
    _, agent, container = executing(campaign, silence=14)
    agent.send_signal(signal.SIGSTOP)
    assert container.wait(PATIENCE) == 0
    agent.send_signal(signal.SIGCONT)
    assert agent.wait(PATIENCE) == 75
    assert campaign.verdicts() == {}


@one_server
def test_a_pod_that_was_held_for_long_goes_on(make: Make) -> None:
    """As with a machine that slept: its clock goes on, and its agent writes a little later."""
    campaign = make("sleep 25\n")
    pod, agent, container = executing(campaign, silence=14)
    held = list(pids_of(pod.work))
    for pid in held:
        os.kill(pid, signal.SIGSTOP)
    time.sleep(16)
    for pid in sorted(held, key=lambda pid: os.getsid(pid) == agent.pid):
        if os.getsid(pid) == agent.pid:
            time.sleep(1)
        os.kill(pid, signal.SIGCONT)
    assert (agent.wait(PATIENCE), container.wait(PATIENCE)) == (0, 0)
    assert campaign.verdicts() == {"one-1/0": "passed"}


@contextlib.contextmanager
def preparing(campaign: Campaign) -> Iterator[Callable[[], object]]:
    """Pods of a campaign come no further than their first request; gives what waits for that."""
    endpoint = campaign.endpoint
    with socket.create_server(("127.0.0.1", 0)) as server, contextlib.ExitStack() as asked:
        server.settimeout(60)
        campaign.endpoint = f"http://127.0.0.1:{server.getsockname()[1]}"
        try:
            yield lambda: asked.enter_context(server.accept()[0])
        finally:
            campaign.endpoint = endpoint


@one_server
def test_a_pod_that_is_told_to_end_while_it_prepares_ends_at_once(make: Make) -> None:
    campaign = make(PASS, PACK)
    pod = Pod(campaign)
    with preparing(campaign) as begun:
        container, agent = pod.start_run(), pod.command("agent")
        begun()
        heartbeat = pod.work / "config/.robovast/heartbeat"
        before = heartbeat.read_text()
        eventually(lambda: heartbeat.read_text() != before)
        agent.terminate()
        assert (agent.wait(PATIENCE), container.wait(PATIENCE)) == (75, 0)
    assert not pod.script.exists()
    assert Pod(campaign).run() == 0
    assert set(campaign.verdicts().values()) == {"passed"}


@one_server
def test_when_the_process_that_prepares_is_killed_another_pod_is_made(make: Make) -> None:
    """As the kernel does it when memory runs out."""
    campaign = make(PASS, PACK)
    pod = Pod(campaign)
    with preparing(campaign) as begun:
        container, agent = pod.start_run(), pod.command("agent")
        begun()
        (prepares,) = (pid for pid in pids_of(pod.work) if os.getsid(pid) == agent.pid != pid)
        os.kill(prepares, signal.SIGKILL)
        assert (agent.wait(PATIENCE), container.wait(PATIENCE)) == (75, 0)
    assert "prepares the runs was ended by SIGKILL" in pod.message()["error"]
    assert Pod(campaign).run() == 0


def is_caught(pid: int, number: int) -> bool:
    """Whether a process handles a signal; one that has just begun does not yet."""
    status = Path(f"/proc/{pid}/status").read_text()
    (mask,) = re.findall(r"^SigCgt:\s*(\w+)$", status, re.MULTILINE)
    return bool(int(mask, 16) >> (number - 1) & 1)


@one_server
@pytest.mark.parametrize("moment", ["before", "while", "when"])
def test_an_agent_that_is_killed_before_its_runs_costs_nothing(make: Make, moment: str) -> None:
    """The containers that wait for it end, so that another pod is made."""
    campaign = make(PASS, PACK)
    pod = Pod(campaign)
    container = pod.start_run(silence=8)
    if moment == "before":
        agent = pod.command("agent")
        agent.kill()  # at once: to look for all of its processes may take longer than its runs
        pod.kill(agent)
        eventually(lambda: is_caught(container.pid, signal.SIGTERM))
        container.terminate()  # as it does itself after ten minutes
    elif moment == "while":
        with preparing(campaign) as begun:
            agent = pod.command("agent")
            begun()
            eventually(lambda: (pod.work / "config/.robovast/heartbeat").read_text().strip())
            pod.kill(agent)
    else:
        assert pod.prepare() == 0
        pod.kill()
    if moment != "when":
        assert container.wait(PATIENCE) == 0
    assert campaign.verdicts() == {}
    later = Pod(campaign)
    assert later.run() == 0
    assert later.message()["passed"] == "0-2"
    assert set(campaign.verdicts().values()) == {"passed"}


@one_server
def test_a_file_of_the_user_with_a_name_of_ours_arrives_and_orders_nothing(make: Make) -> None:
    names = ("start.sh", "order", "heartbeat", "environment.sh")
    step = PASS + 'cd "${0%/*/*}" && cat start.sh order heartbeat environment.sh\n'
    document = DOCUMENT.replace("['files/*']", f"['files/*', {', '.join(names)}]")
    campaign = make(step, document=document, files=dict.fromkeys(names, "end\n"))
    assert Pod(campaign).run() == 0
    assert campaign.verdicts() == {"one-1/0": "passed"}
    assert campaign.read("_jobs/job-0/logs/system.log").count(": end\n") == len(names)


@one_server
def test_a_pod_with_nothing_left_ends_at_once(make: Make) -> None:
    campaign = make(FAIL_SECOND, PACK)
    Pod(campaign).run()
    before = campaign.objects()
    pod = Pod(campaign)
    assert pod.run() == 10
    assert pod.message() == {"passed": "0,2", "failed": "1", "errored": "", "counts": [2, 1, 0]}
    assert campaign.objects() == before


def test_a_repetition_replaces_bad_runs_alone(make: Make) -> None:
    campaign = make('echo "$1" >"$3/first-$1"; [ "$1" = 3 ]\n', PACK)
    assert Pod(campaign).run() == 10
    finishing = Pod(campaign)
    assert finishing.task("finish") == 0
    finished = finishing.message()
    step = campaign.root / "files/files/step.sh"
    step.write_text('echo "$1" >"$3/second-$1"; [ "$1" != 2 ]\n')
    pod = Pod(campaign)
    repeat = finished["repeat"]
    assert repeat["sizes"] == "2x1"
    assert campaign.read(f"_transient/bad-runs-{repeat['list']}.txt") == "0-1"
    assert pod.run(0, "--attempt", 2, "--repeat", repeat["list"]) == 10
    assert pod.message() == {"passed": "0", "failed": "1", "errored": "", "counts": [1, 1, 0]}
    assert set(campaign.objects("one-1/0/")) == {
        "one-1/0/run.json", "one-1/0/second-1", "one-1/0/test.xml",
    }  # fmt: skip
    records = [campaign.record(f"one-{n}/0") for n in (1, 2, 3)]
    assert [record["attempt"] for record in records] == [2, 2, 1]
    assert [record["job"] for record in records] == ["job-0-2", "job-0-2", "job-0"]


def test_of_two_pods_for_one_index_each_run_is_stored_once(make: Make) -> None:
    script = 'echo $RANDOM$RANDOM | tee "$3"/{0..99} >/dev/null\n'
    campaign = make(script, PACK)
    pods = [Pod(campaign), Pod(campaign)]
    agents = []
    for pod in pods:
        pod.start_run()
        agents.append(pod.command("agent"))
    assert [agent.wait(PATIENCE) for agent in agents] == [0, 0]
    for run_path in ("one-1/0", "one-2/0", "one-3/0"):
        keys = keys_by_path(campaign.store, campaign.bucket, run_path)
        files = [campaign.store.read(campaign.bucket, keys[f"{run_path}/{n}"]) for n in range(100)]
        assert len(set(files)) == 1, "files of both"
    jobs = [campaign.record(f"one-{n}/0")["job"] for n in (1, 2, 3)]
    assert set(jobs) <= {"job-0", "job-0-2"}


@one_server
def test_the_log_of_a_run_that_goes_on_is_stored_and_at_its_end_all_of_it(
    make: Make, tmp_path: Path
) -> None:
    hold, log = tmp_path / "hold", "_jobs/job-0/logs/system.log"
    hold.touch()
    campaign = make(f'echo "so far"\nwhile [ -e "{hold}" ]; do sleep 0.1; done\necho "so good"\n')
    pod = Pod(campaign)
    _, agent = pod.start()
    eventually(lambda: log in campaign.objects("_jobs/") and "so far" in campaign.read(log))
    assert campaign.verdicts() == {}
    hold.unlink()
    assert agent.wait(PATIENCE) == 0, pod.log("agent")
    assert "so good" in campaign.read(log)
    assert campaign.verdicts() == {"one-1/0": "passed"}


@one_server
def test_the_server_may_restart_in_the_middle(
    make: Make, s3_server: Server, tmp_path: Path
) -> None:
    hold = tmp_path / "hold"
    hold.touch()
    campaign = make(PASS + f'while [ -e "{hold}" ]; do sleep 0.1; done\n', PACK)
    pod = Pod(campaign)
    _, agent = pod.start()
    eventually(lambda: "Executing scenario" in pod.log("start"))
    s3_server.stop()
    hold.unlink()
    eventually(lambda: "ended with code" in pod.log("start"))
    s3_server.start()
    assert agent.wait(PATIENCE) == 0, pod.log("agent")
    assert set(campaign.verdicts().values()) == {"passed"}


@one_server
def test_killed_at_any_moment_a_campaign_completes(make: Make, tmp_path: Path) -> None:
    hold = tmp_path / "hold"
    waits = f'while grep -q "$1" "{hold}"; do sleep 0.1; done\n'
    campaign = make(PASS + "sleep 0.2\n" + waits, PACK, runs=2)
    chance = random.Random(7)  # noqa: S311
    stored: dict[str, str] = {}
    for index, last in enumerate("23"):
        for held in (True, True, True, False):
            hold.write_text(last if held else "")
            pod = Pod(campaign)
            pod.start_run()
            agent = pod.command("agent", index=index)
            with contextlib.suppress(subprocess.TimeoutExpired):
                assert agent.wait(chance.uniform(0.3, 4.0)) == 0
                assert not held, "it ended before its last run did"
            pod.kill()
            for run_path in campaign.verdicts():
                text = campaign.read(f"{run_path}/run.json")
                assert stored.setdefault(run_path, text) == text, "a stored run ran again"
        assert Pod(campaign).run(index) == 0
    assert set(campaign.verdicts().values()) == {"passed"}
    assert len(campaign.verdicts()) == 6
    for run_path, text in stored.items():
        assert campaign.read(f"{run_path}/run.json") == text, "a stored run ran again"
    assert {key.rsplit("/")[-1] for key in campaign.objects("one-1/")} == {
        "out.csv", "run.json", "test.xml",
    }  # fmt: skip


@one_server
def test_links_to_what_a_run_cannot_see_are_not_followed(make: Make) -> None:
    script = 'ln -s "$KEYS" "$3/keys"; ln -s "$KEYS/secretKey" "$3/key"; mkfifo "$3/pipe"\n'
    campaign = make(script + PASS, "  env: [{KEYS: MOUNTS/credentials}]\n")
    assert Pod(campaign).run() == 0
    names = {"one-1/0/out.csv", "one-1/0/run.json", "one-1/0/test.xml"}
    assert set(campaign.objects("one-1/0")) == names


ODD_NAMES = """
import os
os.chdir(os.environ["FOLDER"])
names = [b"map_" + bytes([n]) + b".pgm" for n in (0xe4, 0xf6)]
names += [bytes([92]) + b"x", b"a" + bytes([10]) + b"b", b"job", b"run.json", b"closed/x"]
names += [chr(0x540d).encode() * 85, b"/".join([b"long" * 50] * 8)]
for name in names:
    os.makedirs(os.path.dirname(name) or b".", exist_ok=True)
    with open(name, "wb") as file:
        file.write(name)
os.chmod("closed/x", 0)
os.chmod("closed", 0)
os.symlink("/etc/passwd", "link")
"""


def test_no_file_is_lost_whatever_its_name_and_mode(make: Make, tmp_path: Path) -> None:
    step = 'FOLDER="$3" python3 "${0%/*}/odd.py"\n'
    campaign = make(step, files={"files/odd.py": ODD_NAMES})
    pod = Pod(campaign)
    assert pod.run() == 0, pod.log("agent")
    home = tmp_path / "home"
    download_campaign(campaign.store, campaign.bucket, home, Silent())
    root = os.fsencode(home / "one-1/0")
    found = {
        os.path.relpath(os.path.join(folder, name), root): Path(
            os.fsdecode(os.path.join(folder, name))
        ).read_bytes()
        for folder, _, names in os.walk(root)
        for name in names
        if name not in {b"test.xml", b"run.json"}
    }
    expected = {name: name for name in (b"map_\xe4.pgm", b"map_\xf6.pgm", b"\\x", b"a\nb")}
    expected |= {name: name for name in (b"closed/x", "名".encode() * 85)}
    expected |= {name: name for name in (b"/".join([b"long" * 50] * 8),)}
    assert found == {**expected, b"job.1": b"job", b"run.json.1": b"run.json"}
    assert (home / "one-1/0/job").is_symlink()
    missing = [{"path": "link", "reason": "it is a link, which is not followed"}]
    assert campaign.record("one-1/0")["missing"] == missing


@one_server
def test_credentials_are_nowhere_but_in_their_files(make: Make) -> None:
    campaign = make("env; cat /proc/$PPID/cmdline\n")
    pod = Pod(campaign)
    pod.run()
    secret = campaign.server.secret_key.encode()
    files = [path for path in pod.work.rglob("*") if path.is_file()]
    assert not [path for path in files if secret in path.read_bytes()]
    assert not [key for key in campaign.objects() if secret.decode() in campaign.read(key)]


@one_server
def test_refused_storage_is_told(make: Make) -> None:
    campaign = make(PASS)
    (campaign.root / "credentials/secretKey").write_text("wrong")
    pod = Pod(campaign)
    assert pod.prepare() == 76
    told = pod.message_file.read_text()
    assert campaign.endpoint in told
    assert "Check the secret key" in told


@one_server
def test_an_agent_that_is_refused_says_so_beside_its_verdicts(
    make: Make, s3_server: Server
) -> None:
    campaign = make(PASS)

    def refuses(method: str, path: str) -> tuple[int, str] | None:
        return (403, "AccessDenied") if method == "PUT" and "/one-1/0/" in path else None

    with refusing(s3_server.endpoint, refuses) as endpoint:
        campaign.endpoint = f"http://{endpoint}"
        pod = Pod(campaign)
        assert pod.run() == 77, "a pod of other runs may succeed"
    told = pod.message()
    assert (told["passed"], told["failed"], told["errored"]) == ("", "", "")
    assert endpoint in told["error"]


WRITES = {
    "no right to make buckets": lambda path: path.count("/") == 1,
    "a key that may read only": lambda path: path.count("/") > 1,
    "a quota that is used up": lambda path: "_transient/job-" in path,
}


@one_server
@pytest.mark.parametrize(
    ("why", "answer", "code"),
    [
        ("no right to make buckets", (403, "AccessDenied"), 76),
        ("a key that may read only", (403, "AccessDenied"), 76),
        ("a quota that is used up", (400, "XMinioAdminBucketQuotaExceeded"), 76),
        ("a quota that is used up", (507, "XMinioStorageFull"), 74),
    ],
)
def test_storage_that_takes_nothing_is_noticed_before_anything_is_executed(
    make: Make, s3_server: Server, why: str, answer: tuple[int, str], code: int
) -> None:
    campaign = make(PASS)
    bucket = f"/{campaign.bucket}"

    def refuses(method: str, path: str) -> tuple[int, str] | None:
        wrong = method == "PUT" and path.startswith(bucket) and WRITES[why](path.rstrip("/"))
        return answer if wrong else None

    with refusing(s3_server.endpoint, refuses) as endpoint:
        campaign.endpoint = f"http://{endpoint}"
        pod = Pod(campaign)
        assert pod.prepare() == code, pod.log("agent")
    assert answer[1] in pod.message_file.read_text()
    assert pod.script.with_name("order").read_text().split() == ["end"], "nothing else was ordered"


@one_server
def test_a_name_that_is_too_long_for_the_server_ends_the_tries(
    make: Make, s3_server: Server
) -> None:
    campaign = make('touch "$3/long"\n')

    def refuses(method: str, path: str) -> tuple[int, str] | None:
        long = method == "PUT" and path.endswith("/long")
        return (400, "KeyTooLongError") if long else None

    with refusing(s3_server.endpoint, refuses) as endpoint:
        campaign.endpoint = f"http://{endpoint}"
        pod = Pod(campaign)
        assert pod.run() == 77, pod.log("agent")
    assert "1,024 bytes" in pod.message()["error"]


@one_server
def test_a_run_that_no_pod_gets_beyond_is_given_up(make: Make) -> None:
    """As one that fills the disk of its node, and is evicted there."""
    campaign = make(PASS, PACK)
    assert Pod(campaign).prepare() == 0
    begun = campaign.read("_transient/job-0.params.yaml").encode()
    assert b"attempt 1, runs 0-2" in begun
    for number in range(2, MOST_STARTS):
        campaign.store.put_bytes(campaign.bucket, f"_transient/job-0-{number}.params.yaml", begun)
    assert Pod(campaign).prepare() == 0, "the last one that may"
    assert campaign.verdicts() == {}
    pod = Pod(campaign)
    assert pod.run() == 11, pod.log("agent")
    assert pod.message() == {"passed": "1-2", "failed": "", "errored": "0", "counts": [2, 0, 1]}
    assert "20 pods ended without a stored result" in campaign.record("one-1/0")["reason"]
    assert campaign.record("one-2/0")["job"] == f"job-0-{MOST_STARTS + 1}"
    name = list_name("0")
    campaign.store.put_bytes(campaign.bucket, list_key(name), b"0")
    again = Pod(campaign)
    assert again.run(0, "--attempt", 2, "--repeat", name) == 0, "a repetition may begin anew"


@one_server
def test_a_run_that_fills_the_disk_is_stored_with_what_it_wrote(make: Make) -> None:
    step = '[ "$1" = 2 ] || exit 0; dd if=/dev/zero of="$3/big" bs=1M count=99 status=none\n'
    campaign = make(step, PACK)
    pod = Pod(campaign)
    with small_disk(pod.work):
        assert pod.run() in {10, 11}, pod.log("agent")
        assert pod.log("agent") == ""
    verdicts = campaign.verdicts()
    assert (verdicts["one-1/0"], len(verdicts)) == ("passed", 3)
    assert verdicts["one-2/0"] != "passed"
    assert "one-2/0/big" in campaign.objects()


@one_server
def test_a_disk_that_is_full_before_the_runs_is_told_and_tried_again(
    make: Make, tmp_path: Path
) -> None:
    pod = Pod(make(PASS, PACK))
    with small_disk(pod.work):
        (pod.work / "agent.log").symlink_to(tmp_path / "agent.log")
        with contextlib.suppress(OSError), (pod.work / "big").open("wb") as file:
            file.write(bytes(2**24))
        assert pod.prepare() == 74
        assert re.fullmatch(
            r"error: (\S+: )?the disk is full\. Free some space, then repeat the command\.\n",
            pod.log("agent"),
        )


@one_server
@pytest.mark.parametrize(
    ("file", "text", "code", "told"),
    [
        ("document.vast", "version: 1\nconfigurations: []\n", 65, "configuration"),
        ("campaign.json", '{"campaign": "x"}', 64, "not a valid plan of this version"),
    ],
)
def test_a_wrong_plan_or_document_is_told(
    make: Make, file: str, text: str, code: int, told: str
) -> None:
    campaign = make(PASS)
    (campaign.root / "plan" / file).write_text(text)
    pod = Pod(campaign)
    assert pod.prepare() == code
    assert told in pod.message_file.read_text()


def test_a_finished_campaign_equals_a_local_one_file_by_file(make: Make, tmp_path: Path) -> None:
    campaign = make(FAIL_SECOND, "  runs_per_job: 2\n")
    assert [Pod(campaign).run(index) for index in (0, 1)] == [10, 0]
    record = campaign.record("one-2/0")
    assert (record["verdict"], record["job"], record["id"]) == ("failed", "job-0", 1)
    assert (record["attempt"], record["parameters"]) == (1, {"x": 2})
    pod = Pod(campaign)
    assert pod.task("finish") == 0, pod.log("finish")
    assert pod.message() == {
        "total": 3, "passed": 2, "failed": 1, "errored": 0, "stored": 3,
        "failedRuns": "1", "erroredRuns": "", "truncated": False, "failing": ["one-2/0"],
        "repeat": {"list": list_name("1"), "sizes": "1x1"},
    }  # fmt: skip
    root = run(campaign.vast, tmp_path / "local").campaign
    own = {INDEX, RUNS_TABLE, "_transient/owner.json", list_key(list_name("1"))}
    of_one_machine = {"_execution/controller.log", INPUTS}
    local = {name for name in files_below(root) if name not in of_one_machine}
    assert set(campaign.objects()) == {*local, *own}
    for name in ("_config/scenario.osc", "one-1/_config/config.yaml", "_transient/entrypoint.sh"):
        assert campaign.read(name) == (root / name).read_text()
    links = "_transient/job_links.yaml"
    assert yaml.safe_load(campaign.read(links)) == yaml.safe_load((root / links).read_text())
    index = json.loads(campaign.read("_execution/index.json"))
    assert [(item["id"], item["verdict"]) for item in index["runs"]] == [
        (0, "passed"), (1, "failed"), (2, "passed"),
    ]  # fmt: skip
    tables = tables_in(campaign.store, campaign.bucket, "c")
    asked = ask([tables], "SELECT config, run, verdict, param_x FROM runs ORDER BY id").rows
    assert asked == [
        ("one-1", 0, "passed", 1),
        ("one-2", 0, "failed", 2),
        ("one-3", 0, "passed", 3),
    ]
    execution = yaml.safe_load(campaign.read("_execution/execution.yaml"))
    assert execution["execution_type"] == "cluster"
    assert execution["execution_time"].startswith("2026-01-02T03:04:05")


@one_server
def test_it_is_recorded_that_runs_were_added(make: Make) -> None:
    campaign = make(PASS)
    assert Pod(campaign).task("finish") == 0
    assert "runs_added" not in yaml.safe_load(campaign.read("_execution/execution.yaml"))
    more = Block(first_variant=0, variants=3, first_run=1, runs=1)
    campaign.change(runs=2, plan=PlanSpec(blocks=(*campaign.plan.plan.blocks, more)))
    assert Pod(campaign).task("finish") == 0
    execution = yaml.safe_load(campaign.read("_execution/execution.yaml"))
    assert (execution["runs"], execution["runs_added"]) == (2, True)


@one_server
@pytest.mark.parametrize("name", ["0123456789abcdef", list_name("0-1")])
def test_a_list_of_bad_runs_that_is_not_what_finish_stored_is_refused(
    make: Make, name: str
) -> None:
    campaign = make(PASS, PACK)
    campaign.store.make_bucket(campaign.bucket)
    campaign.store.put_bytes(campaign.bucket, list_key(list_name("0-1")), b"0-2")
    pod = Pod(campaign)
    assert pod.prepare(0, "--attempt", 2, "--repeat", name) == 64
    assert (
        list_key(name) in pod.message_file.read_text() or "stored" in pod.message_file.read_text()
    )


@one_server
def test_a_campaign_that_was_given_up_counts_missing_runs_as_errored(make: Make) -> None:
    campaign = make(PASS)
    assert Pod(campaign).run(1) == 0
    pod = Pod(campaign)
    assert pod.task("finish") == 0
    told = pod.message()
    assert (told["passed"], told["errored"], told["stored"]) == (1, 2, 1)
    assert (told["erroredRuns"], told["failing"]) == ("0,2", ["one-1/0", "one-3/0"])


PLUGIN = """\
from robovast.common.variation import Variation

class Doubled(Variation):
    def variation(self, in_configs):
        with open(f"{self.output_dir}/made.txt", "w") as file:
            file.write("made by a plugin")
        return [
            {**config, "name": f"{config['name']}-{x}", "config": {"x": x},
             "_config_files": [("files/made.txt", f"{self.output_dir}/made.txt")]}
            for config in in_configs for x in (7, 14)
        ]
"""


@pytest.fixture
def composed(make: Make) -> Campaign:
    """A campaign that a plugin has expanded; its variants are one-7 and one-14."""
    document = DOCUMENT.replace(
        "ParameterVariationList: {name: x, values: [1, 2, 3]}", "./doubled.py:Doubled: {}"
    )
    step = 'cat /config/files/made.txt >"$3/out" || cat "${0%/*}/made.txt" >"$3/out"\n'
    campaign = make(
        step, PACK, expansion="composed", document=document, files={"doubled.py": PLUGIN}
    )
    composing = Pod(campaign)
    assert composing.task("compose") == 0, composing.log("compose")
    found = composing.message()
    assert (found["counts"], found["breaks"]) == ([2], "")
    campaign.change(composed=found["digest"])
    return campaign


@one_server
def test_a_campaign_of_plugins_is_composed_once(composed: Campaign) -> None:
    campaign = composed
    assert Pod(campaign).run() == 0
    assert campaign.read("one-7/0/out") == "made by a plugin"
    assert campaign.record("one-14/0")["parameters"] == {"x": 14}
    finishing = Pod(campaign)
    assert finishing.task("finish") == 0, finishing.log("finish")
    assert finishing.message()["passed"] == 2
    assert "_config/doubled.py" in campaign.objects()


@one_server
@pytest.mark.parametrize(
    "key",
    [
        "_config/doubled.py",
        "_transient/variants/000000.json",
        "_transient/variants/list.json",
        "one-7/_config/files/made.txt",
    ],
)
def test_what_is_not_as_it_was_composed_is_refused_by_name(composed: Campaign, key: str) -> None:
    composed.store.put_bytes(composed.bucket, key, b"[]")
    pod = Pod(composed)
    assert pod.prepare() == 65
    assert f"{key.removeprefix('_config/')}: is another" in pod.message_file.read_text()


@one_server
@pytest.mark.parametrize("change", ["nothing", "edited", "removed"])
def test_inputs_that_are_not_those_of_the_plan_are_refused_by_name(make: Make, change: str) -> None:
    """As those in a ConfigMap that somebody edits while the campaign runs."""
    campaign = make(PASS)
    step = campaign.root / "files/files/step.sh"
    campaign.change(inputs={"files/step.sh": hashlib.sha256(step.read_bytes()).hexdigest()})
    if change == "edited":
        step.write_text("true")
    elif change == "removed":
        step.unlink()
    pod = Pod(campaign)
    assert pod.prepare() == (0 if change == "nothing" else 65)
    said = {"nothing": "", "edited": "is another", "removed": "is missing"}[change]
    assert (f"files/step.sh: {said}" in pod.message_file.read_text()) == bool(said)


@one_server
def test_another_expansion_than_the_planned_one_is_refused(make: Make) -> None:
    campaign = make(PASS)
    with TemporaryDirectory() as scratch:
        variants = compose(load_document(campaign.vast), Path(scratch)).variants
    (entry,) = campaign.plan.entries
    same = entry.model_copy(update={"digest": variants_digest(variants)})
    campaign.change(entries=(same,))
    assert Pod(campaign).prepare() == 0
    campaign.change(entries=(entry.model_copy(update={"digest": variants_digest(variants[:1])}),))
    pod = Pod(campaign)
    assert pod.prepare() == 65
    assert "`one` does not expand to the planned configurations" in pod.message_file.read_text()


@one_server
def test_what_is_wrong_in_a_document_is_told_by_compose(make: Make) -> None:
    campaign = make(PASS)
    (campaign.root / "plan/document.vast").write_text("version: 1\nexecution: {rums: 3}\n")
    pod = Pod(campaign)
    assert pod.task("compose") == 65
    assert "rums" in pod.message()["error"]


@one_server
def test_a_purged_campaign_is_gone(make: Make) -> None:
    campaign = make(PASS)
    assert Pod(campaign).run(1) == 0
    assert Pod(campaign).task("purge") == 0
    assert campaign.bucket not in campaign.store.buckets()
    assert Pod(campaign).task("purge") == 0, "it may be told so again"

#!/usr/bin/env python3
"""How long answers about a campaign take that stays in its bucket, beside downloading it first.

    python tests/bench/bucket_answers.py HOST:PORT ACCESS_KEY SECRET_KEY [--runs 100000]
        [--delay 0.02] [--downloaded 500] [--repeat 5]

`tests/testbed/up --control-plane --s3 minio` brings up a server. Everything passes a proxy that
brings each byte of the server so much later. Prints the wall clock and CPU time of whole commands,
the program's start included: a group-by and the summary, from the table of the runs, and from the
index of a bucket without it; how long until the page has all runs of that campaign, and what was
read for it. Then that of downloading so many runs of three small files each.
"""

from __future__ import annotations

import argparse
import json
import os
import queue
import resource
import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from uuid import uuid4

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.campaigns.finished import finished_campaign
from support.campaigns.owner import OWNER
from support.servers.page import shown

from robovast.agent.bucket import Bucket
from robovast.agent.untrusted_files import store_own_tree
from robovast.analysis.tables.columnar import write_runs
from robovast.analysis.tables.runs import record_rows
from robovast.campaign.layout import EXECUTION_RECORD, INDEX, RUNS_TABLE
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.storage.download import Silent, download_campaign
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.s3 import ObjectStore

QUERY = "SELECT param_speed, verdict, count(*), avg(duration) FROM runs GROUP BY ALL ORDER BY ALL"


def hand_on(
    source: socket.socket,
    target: socket.socket,
    delay: float,
    seen: Callable[[int], object] = lambda _: None,
) -> None:
    """Bytes in their order, each so much later; says how many they are."""
    due: queue.Queue[tuple[float, bytes]] = queue.Queue()

    def bring() -> None:
        with suppress(OSError):
            while True:
                moment, data = due.get()
                time.sleep(max(0.0, moment - time.monotonic()))
                if not data:
                    target.shutdown(socket.SHUT_WR)
                    return
                target.sendall(data)

    threading.Thread(target=bring, daemon=True).start()
    with suppress(OSError):
        while data := source.recv(1 << 18):
            seen(len(data))
            due.put((time.monotonic() + delay, data))
    due.put((0.0, b""))


@contextmanager
def distant(server: str, delay: float) -> Iterator[tuple[str, list[int]]]:
    """The address of a server that is so far away, and sizes of what came from there."""
    host, _, port = server.rpartition(":")
    listener = socket.create_server(("127.0.0.1", 0))
    sizes: list[int] = []

    def serve() -> None:
        with suppress(OSError):
            while True:
                client, _ = listener.accept()
                other = socket.create_connection((host, int(port)))
                for end in (client, other):
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                for given in ((client, other, 0.0), (other, client, delay, sizes.append)):
                    threading.Thread(target=hand_on, args=given, daemon=True).start()

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield f"127.0.0.1:{listener.getsockname()[1]}", sizes
    finally:
        listener.close()


def record(index: int) -> RunRecord:
    bad = index % 11 == 0
    return RunRecord(
        campaign="big", variant=f"hall-{index // 20 + 1}", entry="hall", run=index % 20, id=index,
        verdict=Verdict.FAILED if bad else Verdict.PASSED,
        reason=f"the robot was {index % 97} cm beside its goal" if bad else "",
        started_at="2026-01-01T00:00:00+00:00", finished_at="2026-01-01T00:01:00+00:00",
        duration=60 + index % 331 / 7, exit_code=0, attempt=1, job=f"job-{index // 4}",
        runtime="kubernetes", image="registry/hall:1", image_digest="", host=f"node-{index % 50}",
        seed=index * 7919 % 2**31,
        parameters={"speed": index // 20 % 5 / 2, "map": f"m-{index // 700}"},
    )  # fmt: skip


def timed(action: Callable[[], object]) -> float:
    begin = time.perf_counter()
    action()
    return time.perf_counter() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("address")
    parser.add_argument("access_key")
    parser.add_argument("secret_key")
    parser.add_argument("--runs", type=int, default=100_000)
    parser.add_argument("--delay", type=float, default=0.02)
    parser.add_argument("--downloaded", type=int, default=500)
    parser.add_argument("--repeat", type=int, default=5)
    given = parser.parse_args()
    keys = Credentials(given.access_key, given.secret_key)
    near = ObjectStore(Endpoint.parse(f"http://{given.address}"), keys, connections=8)
    full, listed, small = (f"bench-{uuid4().hex[:10]}" for _ in range(3))
    for bucket in (full, listed, small):
        near.make_bucket(bucket)
    try:
        with TemporaryDirectory() as folder, distant(given.address, given.delay) as far:
            address, sizes = far
            fill(near, full, listed, given.runs, Path(folder))
            os.environ["ROBOVAST_S3_ENDPOINT"] = f"http://{address}"
            os.environ["ROBOVAST_S3_ACCESS_KEY"] = keys.access_key
            os.environ["ROBOVAST_S3_SECRET_KEY"] = keys.secret_key
            ask_all(full, listed, given.repeat)
            for _ in range(given.repeat):
                sizes.clear()
                look(full)
                print(f"  {sum(sizes) / 1e6:.2f} MB came from the server")
            download(near, address, keys, small, given.downloaded, Path(folder))
    finally:
        for bucket in (full, listed, small):
            near.delete_bucket(bucket)


def fill(store: ObjectStore, full: str, listed: str, runs: int, folder: Path) -> None:
    records = [record(index) for index in range(runs)]
    table = folder / "runs.duckdb"
    begin = time.process_time()
    write_runs(table, list(record_rows(records)))
    seconds = time.process_time() - begin
    keys = ("id", "variant", "run", "verdict", "reason", "attempt", "started_at", "duration", "job")
    entries = [{key: getattr(one, key) for key in keys} for one in records]
    index = json.dumps({"campaign": "big", "runs": entries}, indent=1).encode()
    for bucket in (full, listed):
        store.put_bytes(bucket, EXECUTION_RECORD, b"runs: 20\n")
        store.put_bytes(bucket, INDEX, index)
    store.put_file(full, RUNS_TABLE, table)
    size = table.stat().st_size / 1e6
    print(
        f"{runs:,} rows: written in {seconds:.1f} s of CPU, {size:.1f} MB; "
        f"index {len(index) / 1e6:.1f} MB"
    )


def look(bucket: str) -> None:
    """Open the page, and say when what it asks for first has come, by the user's clock."""
    begin = time.perf_counter()
    with shown(None, "--bucket", bucket) as server:
        ready = time.perf_counter() - begin
        runs = len(server.get(f"api/campaigns/{bucket}").data["runs"]["number"])
        listed = time.perf_counter() - begin
        server.get(f"api/campaigns/{bucket}/factors")
        explained = time.perf_counter() - begin
        cpu = sum(map(int, Path(f"/proc/{server.process.pid}/stat").read_text().split()[13:15]))
    print(
        f"page: address after {ready:.2f} s, {runs:,} runs after {listed:.2f} s, factors after "
        f"{explained:.2f} s; {cpu / os.sysconf('SC_CLK_TCK'):.1f} s of CPU; "
        f"load {os.getloadavg()[0]:.0f}"
    )


def ask_all(full: str, listed: str, repeat: int) -> None:
    by_verdict = "SELECT verdict, count(*), avg(duration) FROM runs GROUP BY ALL"
    asked = {
        "group-by, table": ("results", "query", QUERY, "--bucket", full),
        "summary, table": ("results", "summary", "--bucket", full),
        "group-by, index": ("results", "query", by_verdict, "--bucket", listed),
        "`vast --version`": ("--version",),
    }
    for title, words in asked.items():
        command = [sys.executable, "-m", "robovast_cli", *words]
        spent = resource.getrusage(resource.RUSAGE_CHILDREN)
        walls = [
            timed(lambda: subprocess.run(command, check=True, capture_output=True))  # noqa: B023
            for _ in range(repeat)
        ]
        now = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = (now.ru_utime + now.ru_stime - spent.ru_utime - spent.ru_stime) / repeat
        print(
            f"{title}: {statistics.median(walls):.2f} s ({min(walls):.2f}-{max(walls):.2f}), "
            f"{cpu:.2f} s of CPU; load {os.getloadavg()[0]:.0f}"
        )


def download(
    near: ObjectStore, address: str, keys: Credentials, bucket: str, runs: int, folder: Path
) -> None:
    campaign = finished_campaign(folder / "made", runs, runs_per_variant=20)
    store_own_tree(Bucket(near, bucket, OWNER), campaign)
    far = ObjectStore(Endpoint.parse(f"http://{address}"), keys, connections=16)
    seconds = timed(lambda: download_campaign(far, bucket, folder / "home", Silent()))
    print(f"download of {runs} runs: {seconds:.1f} s, {seconds / runs * 1000:.1f} ms each")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""What patience and checksums cost: our object store beside the plain `minio` client.

    python tests/bench/storage.py HOST:PORT ACCESS_KEY SECRET_KEY [--repeat 3]

`tests/testbed/up --control-plane --s3 minio --s3 versitygw` brings up servers. Prints, for 1,000
small files and for one large file, seconds and objects or MB a second of both, and their ratio.
Executions alternate, so that both see the same machine. Then 8 large files are stored at once, as
the agent does it, in a process of its own: the most memory that it took.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import BinaryIO
from uuid import uuid4

from minio import Minio

from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.s3 import ObjectStore

SMALL, SIZE, LARGE = 1000, 4096, 256 * 2**20
THREADS = 8
MANY, EACH = 8, 96 * 2**20
"""Large files that are stored at once, and their size [byte]."""


def timed(action: Callable[[], object]) -> float:
    begin = time.perf_counter()
    action()
    return time.perf_counter() - begin


def all_of(action: Callable[[str, Path], object], pairs: list[tuple[str, Path]]) -> None:
    with ThreadPoolExecutor(THREADS) as pool:
        list(pool.map(lambda pair: action(*pair), pairs))


def compare(
    what: str,
    amount: float,
    unit: str,
    repeat: int,
    own_way: Callable[[], object],
    plain_way: Callable[[], object],
) -> None:
    ours: list[float] = []
    plain: list[float] = []
    for _ in range(repeat):
        plain.append(timed(plain_way))
        ours.append(timed(own_way))
    mine, other = statistics.median(ours), statistics.median(plain)
    print(
        f"{what}: ours {mine:.2f} s ({amount / mine:.0f} {unit}/s), plain client {other:.2f} s "
        f"({amount / other:.0f} {unit}/s), ratio {mine / other:.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("address")
    parser.add_argument("access_key")
    parser.add_argument("secret_key")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--store", nargs=2, metavar=("BUCKET", "FOLDER"), help="that alone")
    arguments = parser.parse_args()
    keys = Credentials(arguments.access_key, arguments.secret_key)
    store = ObjectStore(Endpoint.parse(f"http://{arguments.address}"), keys, connections=THREADS)
    if arguments.store:
        store_as_agent(store, arguments.store[0], Path(arguments.store[1]))
        return
    plain = Minio(
        arguments.address,
        access_key=keys.access_key,
        secret_key=keys.secret_key,
        secure=False,
        region="us-east-1",
    )
    bucket = f"bench-{uuid4().hex[:8]}"
    store.make_bucket(bucket)
    with TemporaryDirectory() as name:
        try:
            bench(store, plain, bucket, Path(name), arguments.repeat)
            memory(bucket, Path(name, "many"))
        finally:
            store.delete_bucket(bucket)


def memory(bucket: str, folder: Path) -> None:
    folder.mkdir()
    content = os.urandom(2**20) * (EACH // 2**20)
    for number in range(MANY):
        (folder / str(number)).write_bytes(content)
    command = [sys.executable, *sys.argv, "--store", bucket, folder]
    begin = time.perf_counter()
    child = subprocess.Popen(command)
    _, status, usage = os.wait4(child.pid, 0)
    seconds = time.perf_counter() - begin
    print(
        f"{MANY} files of {EACH // 2**20} MiB at once: {seconds:.1f} s, "
        f"at most {usage.ru_maxrss / 1024:.0f} MiB of memory, status {status}"
    )


def store_as_agent(store: ObjectStore, bucket: str, folder: Path) -> None:
    import robovast.agent.__main__  # noqa: F401 - what the agent has in memory anyway
    from robovast.agent.untrusted_files import store_files

    def put(path: str, _: int, file: BinaryIO) -> None:
        store.put_new(bucket, f"many/{path}", file)

    store_files(folder, put)


def bench(store: ObjectStore, plain: Minio, bucket: str, folder: Path, repeat: int) -> None:
    small = [(f"small/{number // 10}/{number}", folder / str(number)) for number in range(SMALL)]
    for _, path in small:
        path.write_bytes(os.urandom(SIZE))
    large = [("large", folder / "large")]
    large[0][1].write_bytes(os.urandom(2**20) * (LARGE // 2**20))

    def put(key: str, path: Path) -> None:
        with path.open("rb") as file:
            store.put_new(bucket, key, file)

    def get(pairs: list[tuple[str, Path]]) -> None:
        items = {item.key: item for item in store.objects(bucket)}
        all_of(lambda key, path: store.get_file(bucket, items[key], path), pairs)

    def plain_put(key: str, path: Path) -> None:
        plain.fput_object(bucket, key, str(path))

    def plain_get(key: str, path: Path) -> None:
        plain.fget_object(bucket, key, str(path))

    for what, pairs, amount, unit in (
        (f"{SMALL} files of {SIZE} B", small, SMALL, "objects"),
        (f"a file of {LARGE // 2**20} MiB", large, LARGE / 1e6, "MB"),
    ):
        compare(
            f"put {what}",
            amount,
            unit,
            repeat,
            lambda p=pairs: all_of(put, p),  # type: ignore[misc]
            lambda p=pairs: all_of(plain_put, p),  # type: ignore[misc]
        )
        compare(
            f"get {what}",
            amount,
            unit,
            repeat,
            lambda p=pairs: get(p),  # type: ignore[misc]
            lambda p=pairs: all_of(plain_get, p),  # type: ignore[misc]
        )


if __name__ == "__main__":
    main()

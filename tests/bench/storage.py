#!/usr/bin/env python3
"""What patience and checksums cost: our object store beside the plain `minio` client.

    python tests/bench/storage.py HOST:PORT ACCESS_KEY SECRET_KEY [--repeat 3]

`tests/testbed/up --control-plane --s3 minio --s3 versitygw` brings up servers. Prints, for 1,000
small files and for one large file, seconds and objects or MB a second of both, and their ratio.
Executions alternate, so that both see the same machine.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from uuid import uuid4

from minio import Minio

from robovast.cluster.endpoint import Credentials, Endpoint
from robovast.cluster.storage import ObjectStore

SMALL, SIZE, LARGE = 1000, 4096, 256 * 2**20
THREADS = 8


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
    arguments = parser.parse_args()
    keys = Credentials(arguments.access_key, arguments.secret_key)
    store = ObjectStore(Endpoint.parse(f"http://{arguments.address}"), keys, connections=THREADS)
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
        finally:
            store.delete_bucket(bucket)


def bench(store: ObjectStore, plain: Minio, bucket: str, folder: Path, repeat: int) -> None:
    small = [(f"small/{number // 10}/{number}", folder / str(number)) for number in range(SMALL)]
    for _, path in small:
        path.write_bytes(os.urandom(SIZE))
    large = [("large", folder / "large")]
    large[0][1].write_bytes(os.urandom(2**20) * (LARGE // 2**20))

    def put(key: str, path: Path) -> None:
        with path.open("rb") as stream:
            store.put(bucket, key, stream, is_new=True)

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

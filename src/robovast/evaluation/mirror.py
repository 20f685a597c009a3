"""`python -m robovast.evaluation.mirror`: mirrors campaigns of an S3 server to a folder.

The page of `vast evaluation gui` reads folders; in a cluster the mirror provides them.
"""

from __future__ import annotations

import argparse
import logging
import math
import os
import re
import time
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from robovast.base.atomic import discard, sweep, write_atomically
from robovast.base.errors import StorageError
from robovast.base.safe_paths import read_file
from robovast.campaign.object_keys import OMITTED, ORIGIN
from robovast.model.naming import TRANSIENT, get_campaign_timestamp, is_campaign_dir
from robovast.model.packs import Owner
from robovast.storage.bucket_ownership import owner_of
from robovast.storage.download import Silent, download_campaign
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.folder_ownership import folder_for, occupy
from robovast.storage.s3 import ObjectStore

LOGGER = logging.getLogger(__name__)

USED = 0.8
"""Part of the volume for campaigns; the rest is for those that grow, and for unfinished files."""
_FACTORS = {f"{letter}i": 2.0 ** (10 * n) for n, letter in enumerate("KMGTPE", 1)}
_FACTORS |= {letter: 10.0 ** (3 * n) for n, letter in enumerate("kMGTPE", 1)} | {"": 1.0}
_AMOUNT = re.compile(r"([0-9.]+(?:[eE][0-9]+)?)([kKMGTPE]?i?)")


def in_bytes(amount: str) -> float:
    """Convert an amount of storage as Kubernetes writes it, such as `20Gi` [byte].

    Raises:
        ValueError: it is not an amount.
    """
    match = _AMOUNT.fullmatch(amount)
    if match is None or match[2] not in _FACTORS:
        raise ValueError(f"{amount} is not a valid size, such as 20Gi")
    return float(match[1]) * _FACTORS[match[2]]


@dataclass(frozen=True)
class _Campaign:
    """A campaign of the storage."""

    bucket: str
    name: str
    owner: Owner | None
    size: int
    """[byte]"""


def mirror(store: ObjectStore, results: Path, room: float = math.inf) -> list[str]:
    """Download what is new in the newest campaigns; remove campaigns that no longer exist.

    Args:
        store: the S3 server.
        results: existing folder; folders of campaigns have the same names as local ones, a
            bucket without owner has the bucket's name.
        room: most that the campaigns may take [byte]. A campaign without room gets a folder with
            the file `OMITTED`.

    Returns:
        Buckets that could not be mirrored completely.

    Raises:
        StorageError: the server does not answer.
    """
    failed: list[str] = []
    found: list[_Campaign] = []
    buckets = store.buckets()
    for bucket in buckets:
        with _report_failures(bucket, failed):
            owner = owner_of(store, bucket)
            if owner is not None or is_campaign_dir(bucket):
                name = owner.campaign if owner is not None else bucket
                limited = math.isfinite(room)
                size = sum(item.size for item in store.objects(bucket)) if limited else 0
                found.append(_Campaign(bucket, name, owner, size))
    _remove_purged(store, results, set(buckets))
    found.sort(key=lambda one: (get_campaign_timestamp(one.name) or "", one.bucket), reverse=True)
    fits = fitting([campaign.size for campaign in found], room)
    for campaign, is_kept in sorted(zip(found, fits, strict=True), key=lambda pair: pair[1]):
        with _report_failures(
            campaign.bucket, failed
        ):  # those without room make room for the others
            folder = folder_for(results, campaign.name, campaign.owner)
            if is_kept:
                _download(store, campaign, folder)
            else:
                _leave_out(campaign, folder, room)
    return failed


def fitting(sizes: Sequence[int], room: float) -> list[bool]:
    """Which of some campaigns fit into the room, if the first ones go before the others.

    A campaign that does not fit leaves its room to the smaller ones after it.
    """
    fits = []
    for size in sizes:
        fits.append(size <= room)
        room -= size if fits[-1] else 0
    return fits


@contextmanager
def _report_failures(bucket: str, failed: list[str]) -> Iterator[None]:
    """Log and note an error of one bucket, which must not stop the others."""
    try:
        yield
    except StorageError as error:
        LOGGER.warning("%s: %s", bucket, error)
        failed.append(bucket)
    except Exception:
        LOGGER.exception("%s", bucket)
        failed.append(bucket)


def _download(store: ObjectStore, campaign: _Campaign, folder: Path) -> None:
    (folder / OMITTED).unlink(missing_ok=True)
    for warning in download_campaign(store, campaign.bucket, folder, Silent()).warnings:
        LOGGER.info("%s: %s", campaign.bucket, warning)
    write_atomically(folder / ORIGIN, campaign.bucket, lasting=False)


def _leave_out(campaign: _Campaign, folder: Path, room: float) -> None:
    """Replace the copy of a campaign by the reason why the web UI does not show it."""
    omitted_file = folder / OMITTED
    if os.path.exists(omitted_file):
        return
    if os.path.exists(folder):
        discard(folder)
    occupy(folder, campaign.owner)
    (folder / TRANSIENT).mkdir(parents=True, exist_ok=True)
    write_atomically(folder / ORIGIN, campaign.bucket, lasting=False)
    reason = (
        f"{campaign.name} is not shown: it has {campaign.size / 2**20:,.0f} MiB, and the newer "
        f"campaigns leave no room for it in the {room / 2**20:,.0f} MiB of this web UI. Raise the "
        "chart value page.size, or download the campaign with `vast results download`."
    )
    LOGGER.info("%s", reason)
    write_atomically(omitted_file, reason, lasting=False)


def _remove_purged(store: ObjectStore, results: Path, buckets: Collection[str]) -> None:
    """Remove campaigns whose bucket is gone; never folders that did not come from a bucket."""
    sweep(results)
    for origin in results.glob(f"*/{ORIGIN}"):
        bucket = read_file(origin).decode()
        if bucket not in buckets and not store.has_bucket(bucket):
            LOGGER.info("%s: its bucket %s is gone", origin.parent.name, bucket)
            discard(origin.parent)


def main() -> None:
    """Mirror in an endless loop."""
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s", level=logging.INFO)
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--endpoint", required=True, help="URL of the S3 server")
    parser.add_argument("--region", default="")
    parser.add_argument("--credentials", type=Path, required=True, help="folder with the keys")
    parser.add_argument("--into", type=Path, required=True, help="results folder")
    parser.add_argument("--size", type=in_bytes, default=math.inf, help="room, such as 20Gi")
    parser.add_argument("--every", type=float, default=60, help="time between two looks [s]")
    options = parser.parse_args()
    endpoint = Endpoint.parse(options.endpoint, options.region)
    store = ObjectStore(endpoint, Credentials.from_folder(options.credentials))
    while True:
        try:
            mirror(store, options.into, USED * options.size)
        except StorageError as error:
            LOGGER.warning("%s", error)
        time.sleep(options.every)


if __name__ == "__main__":
    main()

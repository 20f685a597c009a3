"""`python -m robovast.evaluation.mirror`: mirrors campaigns of an S3 server to a folder.

The page of `vast evaluation gui` reads folders; in a cluster the mirror provides them.
"""

from __future__ import annotations

import argparse
import logging
import time
from collections.abc import Collection
from pathlib import Path

from robovast.base.atomic import discard, sweep, write_atomically
from robovast.base.errors import StorageError
from robovast.campaign.places import ORIGIN
from robovast.model.naming import is_campaign_dir
from robovast.storage.bucket_ownership import owner_of
from robovast.storage.download import Silent, download_campaign
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.folder_ownership import folder_for
from robovast.storage.s3 import ObjectStore

LOGGER = logging.getLogger(__name__)


def mirror(store: ObjectStore, results: Path) -> list[str]:
    """Download what is new in every campaign; remove campaigns that no longer exist.

    Args:
        store: the S3 server.
        results: existing folder; folders of campaigns have the same names as local ones, a
            bucket without owner has the bucket's name.

    Returns:
        Buckets that could not be mirrored completely.

    Raises:
        StorageError: the server does not answer.
    """
    failed = []
    buckets = store.buckets()
    for bucket in buckets:
        try:
            owner = owner_of(store, bucket)
            if owner is not None or is_campaign_dir(bucket):
                name = owner.campaign if owner is not None else bucket
                folder = folder_for(results, name, owner)
                for warning in download_campaign(store, bucket, folder, Silent()).warnings:
                    LOGGER.info("%s: %s", bucket, warning)
                write_atomically(folder / ORIGIN, bucket, lasting=False)
        except StorageError as error:
            LOGGER.warning("%s: %s", bucket, error)
            failed.append(bucket)
        except Exception:  # one bucket's content must not stop the others
            LOGGER.exception("%s", bucket)
            failed.append(bucket)
    _remove_purged(store, results, set(buckets))
    return failed


def _remove_purged(store: ObjectStore, results: Path, buckets: Collection[str]) -> None:
    """Remove campaigns whose bucket is gone; never folders that did not come from a bucket."""
    sweep(results)
    for origin in results.glob(f"*/{ORIGIN}"):
        bucket = origin.read_text(encoding="utf-8")
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
    parser.add_argument("--every", type=float, default=60, help="time between two looks [s]")
    options = parser.parse_args()
    endpoint = Endpoint.parse(options.endpoint, options.region)
    store = ObjectStore(endpoint, Credentials.from_folder(options.credentials))
    while True:
        try:
            mirror(store, options.into)
        except StorageError as error:
            LOGGER.warning("%s", error)
        time.sleep(options.every)


if __name__ == "__main__":
    main()

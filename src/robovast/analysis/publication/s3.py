"""The publication plugin `s3`: uploads archives, or campaigns file by file, to a bucket."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from robovast.analysis.publication.context import PublicationContext, context_of
from robovast.analysis.publication.selection import files_of
from robovast.base.backoff import REPEATABLE
from robovast.base.environment import environment
from robovast.base.errors import InputError
from robovast.base.optional_deps import CLUSTER

if TYPE_CHECKING:
    from robovast.storage.s3 import ObjectStore

DEFAULT = "https://s3.amazonaws.com"
"""Default address of the server."""
THREADS = 8
"""Number of parallel uploads."""

_KEYS = (
    ("ROBOVAST_S3_ACCESS_KEY", "ROBOVAST_S3_SECRET_KEY"),
    ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"),
)


class S3Upload:
    """Uploads archives of previous plugins, or the campaigns themselves."""

    plugin_type: ClassVar[str] = "upload"

    def check(
        self,
        results_dir: str,
        config_dir: str,
        context: PublicationContext,
        bucket: str,
        endpoint: str = DEFAULT,
        region: str | None = None,
        **_others: Any,
    ) -> None:
        """Check that credentials exist; the server is not contacted.

        Raises:
            RobovastError: credentials or a package are missing, or the address is invalid.
        """
        del results_dir, config_dir, context, bucket
        _store(endpoint, region)

    def __call__(
        self,
        results_dir: str,
        config_dir: str,
        bucket: str,
        endpoint: str = DEFAULT,
        region: str | None = None,
        prefix: str = "",
        unpacked: bool = False,
        context: PublicationContext | None = None,
    ) -> tuple[bool, str]:
        """Upload archives to an S3 bucket; objects with equal content are skipped.

        Args:
            results_dir: folder of the campaigns.
            config_dir: not used.
            bucket: name of the bucket; it is created if missing.
            endpoint: address of the server.
            region: the bucket's region.
            prefix: prefix of all object names, such as `results/`.
            unpacked: upload the campaigns' files in place of archives; links are left out.
            context: what to publish; by default all campaigns in the folder.
        """
        del config_dir
        context = context or context_of(Path(results_dir))
        files = {f"{prefix}{name}": path for name, path in _files(context, unpacked=unpacked)}
        store = _store(endpoint, region)
        store.make_bucket(bucket)
        sent = _send(store, bucket, files, context)
        kept = f", {len(files) - sent} existed already" if sent < len(files) else ""
        return True, f"{sent} files sent to {endpoint}/{bucket}/{prefix}{kept}"


def _files(context: PublicationContext, *, unpacked: bool) -> Iterator[tuple[str, Path]]:
    if not unpacked and not context.files:
        raise InputError(
            "there is nothing to upload to S3",
            hint="put a plugin that packs, as `zip`, into `results_processing.publication`, or "
            "set `unpacked: true`",
        )
    if not unpacked:
        yield from ((path.name, path) for path in context.files)
        return
    for campaign in context.campaigns:
        for name, path in files_of(campaign.path):
            if not os.path.islink(path):
                yield f"{campaign.name}/{name}", path


def _send(
    store: ObjectStore, bucket: str, files: Mapping[str, Path], context: PublicationContext
) -> int:
    """Upload files in parallel; return the number of new ones."""
    sent = done = 0
    pool = ThreadPoolExecutor(THREADS)
    try:
        futures = [pool.submit(store.put_file, bucket, key, path) for key, path in files.items()]
        for future in as_completed(futures):
            sent += future.result()
            done += 1
            context.progress(bucket, done, len(files))
    finally:
        pool.shutdown(cancel_futures=True)
    return sent


def _store(endpoint: str, region: str | None) -> ObjectStore:
    with CLUSTER.needed_by("S3"):
        from robovast.storage.endpoint import Credentials, Endpoint
        from robovast.storage.s3 import ObjectStore
    variables = environment()
    found = ([variables.get(name) for name in names] for names in _KEYS)
    access, secret = next((keys for keys in found if all(keys)), (None, None))
    if not access or not secret:
        raise InputError(
            "S3 needs the keys of an account",
            hint="set ROBOVAST_S3_ACCESS_KEY and ROBOVAST_S3_SECRET_KEY in the environment or a "
            "`.env` file",
        )
    return ObjectStore(
        Endpoint.parse(endpoint, region),
        Credentials(access, secret),
        patience=REPEATABLE,
        connections=THREADS,
    )

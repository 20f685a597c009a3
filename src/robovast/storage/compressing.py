"""Makes a campaign's archive from its bucket, with the same content as a download."""

from __future__ import annotations

import gzip
import io
import tarfile
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing, contextmanager
from functools import partial
from itertools import count
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

from robovast.base.atomic import appearing_file
from robovast.base.errors import InputError
from robovast.campaign.layout import RUN_RECORD
from robovast.storage.bucket_runs import BucketFile, in_batches, open_run
from robovast.storage.download import THREADS, job_link
from robovast.storage.download_plan import DownloadPlan, plan_download, renamed_warnings
from robovast.storage.s3 import ObjectStore


def pack_bucket(
    store: ObjectStore,
    bucket: str,
    campaign: str,
    archive: Path,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> list[str]:
    """Write the `.tar.gz` of a campaign in a bucket.

    Equal buckets produce equal archives. Files are downloaded a few at a time and verified, so that
    the disk needs little more space than the archive.

    Args:
        store: the S3 server.
        bucket: the campaign's bucket.
        campaign: name of the campaign's folder in the archive.
        archive: the file; it appears when it is complete.
        progress: called with the number of archived bytes, and of all bytes.

    Returns:
        Warnings about objects that are left out or stored under other paths.

    Raises:
        InputError: the bucket is empty.
        ObjectError: an object is damaged or missing.
        StorageError: the bucket cannot be read, or the archive cannot be written.
    """
    plan = plan_download(store.objects(bucket), archive.parent / campaign, force=True)
    if not plan.files and not plan.runs:
        raise InputError(
            f"the bucket {bucket} of {campaign} is empty: there is nothing to pack.",
            hint="wait until a run has finished",
        )
    warnings = list(plan.warnings)
    records = {f"{run.path}/{RUN_RECORD}" for run in plan.runs}
    total = sum(file.item.size for file in plan.files) + sum(run.size for run in plan.runs)
    done = 0
    files = _files(store, bucket, plan, warnings)
    with (
        appearing_file(archive) as part,
        _written(part) as tar,
        closing(_fetched(store, bucket, files, archive.parent)) as fetched,
    ):
        for file, path in fetched:
            modified = int(file.item.modified)
            _add(tar, f"{campaign}/{file.path}", path, modified)
            if file.path in records:
                _add_link(tar, PurePosixPath(campaign, file.path).parent, path, modified)
            path.unlink()
            done += file.item.size
            progress(done, total)
    progress(done, done)
    return warnings


def _files(
    store: ObjectStore, bucket: str, plan: DownloadPlan, warnings: list[str]
) -> Iterator[BucketFile]:
    """Files for the archive in a fixed order: the campaign's files, then its runs.

    Args:
        store: the S3 server.
        bucket: the campaign's bucket.
        plan: the content of the bucket.
        warnings: collects files that are stored under other paths.
    """
    yield from sorted(plan.files, key=lambda file: file.path)
    with ThreadPoolExecutor(THREADS, "open") as pool:
        for batch in in_batches(sorted(plan.runs, key=lambda run: run.path)):
            for run in pool.map(partial(open_run, store, bucket), batch):
                warnings += renamed_warnings(run.apart)
                yield from run.files


@contextmanager
def _written(path: Path) -> Iterator[tarfile.TarFile]:
    """A compressed tar file without information on time and place of its creation."""
    with (
        path.open("wb") as file,
        gzip.GzipFile("", "wb", fileobj=file, mtime=0) as compressed,
        tarfile.open(fileobj=compressed, mode="w", format=tarfile.PAX_FORMAT) as tar,
    ):
        yield tar


def _fetched(
    store: ObjectStore, bucket: str, files: Iterable[BucketFile], folder: Path
) -> Generator[tuple[BucketFile, Path], None, None]:
    """Each file in order, with a local copy of its content; the next ones download in parallel."""
    with TemporaryDirectory(prefix=".packing-", dir=folder) as scratch:
        names = count()

        def fetch(file: BucketFile) -> tuple[BucketFile, Path]:
            path = Path(scratch, str(next(names)))
            file.bring(store, bucket, path)
            return file, path

        pool = ThreadPoolExecutor(THREADS, "pack")
        coming: deque[Future[tuple[BucketFile, Path]]] = deque()
        try:
            for file in files:
                coming.append(pool.submit(fetch, file))
                if len(coming) > THREADS:
                    yield coming.popleft().result()
            while coming:
                yield coming.popleft().result()
        finally:
            pool.shutdown(cancel_futures=True)


def _add(tar: tarfile.TarFile, name: str, path: Path, modified: int) -> None:
    found = path.stat()
    entry = _entry(name, modified)
    entry.size = found.st_size
    entry.mode = 0o755 if found.st_mode & 0o100 else 0o644
    with path.open("rb") as file:
        tar.addfile(entry, file)


def _add_link(tar: tarfile.TarFile, run: PurePosixPath, record: Path, modified: int) -> None:
    """Add the link to the run's job, since S3 cannot store links."""
    target = job_link(record)
    if target is not None:
        entry = _entry(f"{run}/job", modified)
        entry.type = tarfile.SYMTYPE
        entry.linkname = target.as_posix()
        tar.addfile(entry, io.BytesIO())


def _entry(name: str, modified: int) -> tarfile.TarInfo:
    entry = tarfile.TarInfo(name)
    entry.mtime = modified
    return entry

"""A campaign's archive, made of its bucket: what a download would bring, in one file."""

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
from robovast.storage.download import THREADS, DownloadPlan, job_link, plan_download, told_apart
from robovast.storage.s3 import ObjectStore


def pack_bucket(
    store: ObjectStore,
    bucket: str,
    campaign: str,
    archive: Path,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> list[str]:
    """Write the `.tar.gz` of a campaign that is in a bucket.

    Equal buckets make equal archives. Files are fetched some at a time and verified, so that the
    disk needs room for the archive, and little more.

    Args:
        store: the S3 server.
        bucket: the campaign's bucket.
        campaign: name of the campaign's folder in the archive.
        archive: the file; it appears when it is complete.
        progress: is told how many bytes of the campaign are in it, of how many.

    Returns:
        What of the bucket is not in it, or in another place.

    Raises:
        InputError: the bucket is empty.
        ObjectError: an object is not what it should be.
        StorageError: the bucket cannot be read, or the archive cannot be written.
    """
    plan = plan_download(store.objects(bucket), archive.parent / campaign, force=True)
    if not plan.files and not plan.runs:
        raise InputError(f"the bucket {bucket} of {campaign} is empty: there is nothing to pack.")
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
    """What belongs into the archive, in an order of its own: the campaign's files, then its runs.

    Args:
        store: the S3 server.
        bucket: the campaign's bucket.
        plan: what is in it.
        warnings: gets what is in another place.
    """
    yield from sorted(plan.files, key=lambda file: file.path)
    with ThreadPoolExecutor(THREADS, "open") as pool:
        for batch in in_batches(sorted(plan.runs, key=lambda run: run.path)):
            for run in pool.map(partial(open_run, store, bucket), batch):
                warnings += told_apart(run.apart)
                yield from run.files


@contextmanager
def _written(path: Path) -> Iterator[tarfile.TarFile]:
    """A compressed tar file that says nothing of when and where it was made."""
    with (
        path.open("wb") as file,
        gzip.GzipFile("", "wb", fileobj=file, mtime=0) as compressed,
        tarfile.open(fileobj=compressed, mode="w", format=tarfile.PAX_FORMAT) as tar,
    ):
        yield tar


def _fetched(
    store: ObjectStore, bucket: str, files: Iterable[BucketFile], folder: Path
) -> Generator[tuple[BucketFile, Path], None, None]:
    """Each file, in order, with one of its content here; the next ones are on their way."""
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
    """What S3 cannot hold: the link to the job that executed the run."""
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

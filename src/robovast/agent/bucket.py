"""A campaign's bucket as pods see it: which runs are stored, which jobs were claimed.

Keys are the paths of the local results layout, but for a run's files: each of its writers has a
place of its own (robovast.campaign.run_files). A run is stored when its `run.json` is, which is
written last and names its files. Nobody removes what another record may name, but `finish`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from typing import BinaryIO

from robovast.agent.pack import job_name
from robovast.base.errors import StorageError
from robovast.campaign.layout import RUN_RECORD, parameters_key
from robovast.campaign.object_keys import Keys
from robovast.campaign.run_files import FileList, StoredFile, Writer, write_list
from robovast.campaign.run_record import RunRecord, parse_run_record
from robovast.campaign.verdict import Verdict
from robovast.model.packs import Owner
from robovast.model.plan import Run
from robovast.storage.bucket_ownership import OWNER, OtherOwnerError, claim, is_owned
from robovast.storage.s3 import ObjectStore

MOST_JOBS = 10_000
"""Most jobs of one pack; each pod that begins it claims some."""


def seen_record(store: ObjectStore, bucket: str, run: str) -> tuple[RunRecord | None, str | None]:
    """The record of a run (None if there is none that can be read), and its ETag.

    Raises:
        StorageError: the storage refuses, or is gone for too long.
    """
    found = store.look(bucket, f"{run}/{RUN_RECORD}")
    return (parse_run_record(found.content), found.etag) if found else (None, None)


class Bucket:
    """Records of runs and names of jobs.

    Every method raises `StorageError` when the server refuses, or is gone for too long.
    """

    def __init__(self, store: ObjectStore, name: str, owner: Owner) -> None:
        """
        Args:
            store: the S3 server.
            name: name of the bucket.
            owner: the campaign that it belongs to.
        """
        self.store = store
        self.name = name
        self._owner = owner

    def claim(self) -> None:
        """Create the bucket with its owner, unless that was done before.

        Raises:
            OtherOwnerError: it is another campaign's.
        """
        claim(self.store, self.name, self._owner)

    def remove(self) -> None:
        """Remove the bucket with its content, if it exists.

        Raises:
            OtherOwnerError: it is another campaign's, or it has content and names no owner.
        """
        owned = is_owned(self.store, self.name, self._owner.uid)
        if not owned and self.store.has_bucket(self.name) and any(self.store.objects(self.name)):
            raise OtherOwnerError(f"the bucket {self.name} does not name its owner.")
        self.store.delete_bucket(self.name, last=OWNER, content=owned)

    def record(self, run: str) -> RunRecord | None:
        """The record of a run, by `<variant>/<number>`; None when it is not stored."""
        return self.seen(run)[0]

    def seen(self, run: str) -> tuple[RunRecord | None, str | None]:
        """The record of a run (None if there is none that can be read), and its ETag."""
        return seen_record(self.store, self.name, run)

    def settle(self, run: str, record: RunRecord, etag: str | None) -> bool:
        """Store a run's record; return False if the record was replaced since it was read.

        Args:
            run: by `<variant>/<number>`.
            record: the record; the files that it names are stored already.
            etag: ETag of the record that was read; None if there was none.
        """
        key, text = f"{run}/{RUN_RECORD}", record.to_json().encode()
        if etag is None:
            return self.store.create(self.name, key, text)
        return self.store.replace(self.name, key, text, etag)

    def store_list(self, writer: Writer, files: Sequence[StoredFile]) -> FileList:
        """Store the list of a run's files, which are stored already; it is this writer's alone."""
        content = write_list(files)
        self.store.create(self.name, f"{writer.run}/{writer.list_key}", content)
        return FileList(
            key=writer.list_key,
            sha256=hashlib.sha256(content).hexdigest(),
            count=len(files),
            size=sum(file.size for file in files),
        )

    def put(self, key: str, file: BinaryIO, there: Keys) -> bool:
        """Store the content of an open file; return False if the key exists already.

        Args:
            key: of the object; a neighbouring one is used if another object blocks its path.
            file: its content.
            there: keys that exist already.
        """
        place = there.beside(key)
        if place != key:
            print(f"{key}: stored as {place}, since the bucket has a file in its way")  # noqa: T201
        if place in there:
            return self.store.put(self.name, place, file)
        self.store.put_new(self.name, place, file)
        return True

    def verdicts(self, runs: Iterable[Run], attempt: int) -> dict[int, Verdict]:
        """Verdicts of the runs stored by this attempt or a later one, by run id."""
        records = ((run.id, self.record(run.path)) for run in runs)
        return {id_: r.verdict for id_, r in records if r is not None and r.attempt >= attempt}

    def first_free_job(self, pack: int) -> int:
        """The first number of a job of the pack that nobody has claimed, from 1."""
        return self._first(pack, 1, lambda key: self.store.digest(self.name, key) is None)

    def claim_job(self, pack: int, first: int, content: bytes) -> int:
        """Claim a job for the caller alone, and return its number.

        Args:
            pack: of the job.
            first: the number to try first.
            content: the job's parameter documents, different for every caller.
        """
        return self._first(pack, first, lambda key: self.store.create(self.name, key, content))

    def _first(self, pack: int, first: int, fits: Callable[[str], bool]) -> int:
        """The first number of a job whose parameters' key fits.

        Raises:
            StorageError: none does, so the server's answers are wrong.
        """
        for number in range(first, first + MOST_JOBS):
            if fits(parameters_key(job_name(pack, number))):
                return number
        raise StorageError(
            f"{self.name}: the server reports that {MOST_JOBS:,} folders like "
            f"`_jobs/{job_name(pack, 0)}` exist, more than can be",
            hint="check the server, or a proxy on the way to it",
        )

    def claim_of(self, pack: int, number: int) -> bytes:
        """The content of a job's claim; empty if there is none."""
        return self.store.read(self.name, parameters_key(job_name(pack, number))) or b""

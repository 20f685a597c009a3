"""What Kubernetes says of pods, in the records of the runs that they executed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from robovast.agent.bucket import Bucket
from robovast.campaign.judge import CONTAINER_KILLED, OUT_OF_MEMORY
from robovast.campaign.run_record import RunRecord
from robovast.kubeapi.pod_contract.sightings import Sightings


def read_sightings(folder: Path) -> Sightings:
    """What was seen of pods, as it is mounted; nothing where nothing is."""
    files = (path for path in sorted(folder.glob("*")) if path.is_file())
    return Sightings.together(Sightings.load(path.read_bytes()) for path in files)


def completed(
    bucket: Bucket, run: str, sightings: Sightings
) -> tuple[RunRecord | None, str | None]:
    """The record of a run and its ETag, with what its pod could not know.

    Raises:
        StorageError: the bucket cannot be read or written.
    """
    record, etag = bucket.seen(run)
    if record is None:
        return None, etag
    better = with_sightings(record, sightings)
    if better == record or not bucket.settle(run, better, etag):
        return record, etag
    return bucket.seen(run)


def with_sightings(record: RunRecord, sightings: Sightings) -> RunRecord:
    """A record with what was seen of the very pod that executed the run."""
    image = record.image_digest or sightings.images.get(record.pod, "")
    reason = record.reason
    if record.pod in sightings.out_of_memory:
        reason = reason.replace(CONTAINER_KILLED, OUT_OF_MEMORY)
    return replace(record, image_digest=image, reason=reason)

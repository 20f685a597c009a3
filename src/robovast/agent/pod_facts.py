"""Adds what Kubernetes says about pods to the records of their runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from robovast.agent.bucket import Bucket
from robovast.campaign.judge import CONTAINER_KILLED, OUT_OF_MEMORY
from robovast.campaign.run_record import RunRecord
from robovast.kubeapi.pod_contract.pod_facts import Sightings


def read_sightings(folder: Path) -> Sightings:
    """Read the mounted sightings of pods; empty if there are none."""
    files = (path for path in sorted(folder.glob("*")) if path.is_file())
    return Sightings.together(Sightings.load(path.read_bytes()) for path in files)


def completed(
    bucket: Bucket, run: str, sightings: Sightings
) -> tuple[RunRecord | None, str | None]:
    """The record of a run, completed by its pod's sighting, and its ETag.

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
    """Complete a record by the sighting of the very pod that executed the run."""
    image = record.image_digest or sightings.images.get(record.pod, "")
    reason = record.reason
    if record.pod in sightings.out_of_memory:
        reason = reason.replace(CONTAINER_KILLED, OUT_OF_MEMORY)
    return replace(record, image_digest=image, reason=reason)

"""Claims of jobs in the bucket, and runs that were started in vain too often.

A job is claimed before it is executed, so that the bucket counts the pods that began with the same
runs, whatever became of them, of the operator and of the cluster's own records.
"""

from __future__ import annotations

import socket
import time
from dataclasses import replace
from pathlib import Path
from uuid import uuid4

from robovast.agent.bucket import Bucket
from robovast.agent.pack import Pack
from robovast.base.ranges import format_ranges, spans
from robovast.campaign.records import EndedRun
from robovast.campaign.verdict import TestResult, Verdict
from robovast.execution.job_config import parameter_documents
from robovast.model.plan import PackStart

MOST_STARTS = 20
"""How many pods may start a run without storing it."""


def claim_job(bucket: Bucket, pack: Pack, job: PackStart) -> int:
    """Claim a job for this pod alone, and return its number.

    Raises:
        StorageError: the bucket cannot be written.
    """
    who = f"{socket.gethostname()} {uuid4().hex}"
    documents = parameter_documents(job, pack.scenario)
    content = f"# {_task(pack, job)}, executed by {who}\n{documents}".encode()
    return bucket.claim_job(pack.number, pack.first_job + job.index - 1, content)


def hopeless(bucket: Bucket, pack: Pack) -> EndedRun | None:
    """The run that ends every pod of a pack; None while its pods may continue.

    Runs that are stored are left to no later job, so that all jobs between two that were for the
    same runs were for them, too.

    Raises:
        StorageError: the bucket cannot be read.
    """
    job = pack.first
    early = pack.first_job - MOST_STARTS
    if job is None or early < 1:
        return None
    mark, _, _ = bucket.claim_of(pack.number, early).partition(b"\n")
    if f"# {_task(pack, job)}," not in mark.decode("utf-8", "replace"):
        return None
    reason = (
        f"{MOST_STARTS} pods ended without a stored result of the run. Possible causes: the pod "
        "filled the disk and was evicted, its node failed, or the storage is full. The run is "
        "not repeated."
    )
    now = time.time()
    last = replace(job, runs=job.runs[:1], own_name=pack.job_name(pack.first_job - 1))
    result = TestResult(Verdict.ERRORED, reason)
    return EndedRun(last, job.runs[0], Path(), result, (now, now), None)


def _task(pack: Pack, job: PackStart) -> str:
    return f"attempt {pack.attempt}, runs {format_ranges(spans(run.id for run in job.runs))}"

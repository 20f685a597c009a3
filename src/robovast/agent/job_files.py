"""Prepares the folders of a pod's containers for a job."""

from __future__ import annotations

import shlex
from collections.abc import Mapping

from robovast.agent.mounts import Folders
from robovast.agent.pack import Pack, PodStart
from robovast.base import safe_paths
from robovast.campaign.layout import JOBS, LOGS, Layout
from robovast.execution.job_config import (
    PARAMETER_FILE,
    SEED_VARIABLE,
    is_pack,
    own_environment,
    parameter_documents,
)
from robovast.model.scenario import Scenario

ENVIRONMENT_FILE = "environment.sh"


def prepare_output(folders: Folders, job: PodStart) -> None:
    """Create the folders that a job writes to, in place of those of earlier jobs."""
    out = folders.out
    safe_paths.remove(out / JOBS, out)
    safe_paths.make_folder(Layout(out).job(job.name) / LOGS, out)
    if not is_pack(job):
        safe_paths.make_folder(out / job.runs[0].path, out)


def write_environment(folders: Folders, environment: Mapping[str, str]) -> None:
    """Write the environment of a job as start.sh reads it."""
    lines = (f"export {name}={shlex.quote(value)}\n" for name, value in environment.items())
    (folders.orders / ENVIRONMENT_FILE).write_text("".join(lines), encoding="utf-8")


def write_parameters(folders: Folders, job: PodStart, scenario: Scenario) -> None:
    """Write the parameters of a job's runs."""
    parameters = parameter_documents(job, scenario)
    (folders.config / PARAMETER_FILE).write_text(parameters, encoding="utf-8")


def prepare_later_job(folders: Folders, pack: Pack, job: PodStart) -> None:
    """Replace the inputs of the job before by those of this one."""
    write_parameters(folders, job, pack.scenario)
    common = {k: value for k, value in pack.environment.items() if k != SEED_VARIABLE}
    write_environment(folders, {**common, **own_environment(job, folders.out_seen)})
    prepare_output(folders, job)

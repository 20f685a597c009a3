"""The layout of a campaign, as a folder or a bucket: the path of everything in it.

```
<name>-YYYY-MM-DD-HHMMSS/
  _config/            the .vast file, the scenario, run files, notebooks
  _execution/         execution.yaml, index.json; tables.duckdb and data.db for queries
  _transient/         configurations.yaml, the run contract, job-N.params.yaml, job_links.yaml
  _jobs/job-N/        sysinfo.yaml, logs/system.log, resource_usage_*.csv
  <variant>/_config/  config.yaml, scenario.config, files of this variant
  <variant>/<run>/    test.xml, what the run wrote, run.json, job -> ../../_jobs/job-N
  .running/job-N/     runs in progress; removed at the end of the campaign
  campaign.db, metadata.yaml, metadata.prov.json    made by postprocessing
  .aside/<variant>/<run>   unexpected content found in a run's place; never read
```
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from robovast.base.printable import is_printable
from robovast.base.safe_paths import is_folder, names
from robovast.model.naming import CONFIG, EXECUTION, TRANSIENT, is_run_number
from robovast.model.naming import TEST_RESULT as TEST_RESULT

JOBS = "_jobs"
CONFIGURATIONS = f"{TRANSIENT}/configurations.yaml"
"""This and the following paths are relative to the campaign's folder, or keys in its bucket."""
JOB_LINKS = f"{TRANSIENT}/job_links.yaml"
PARTS = f"{TRANSIENT}/variants/"
"""Of a composed campaign in a bucket: its variants in parts."""
EXECUTION_RECORD = f"{EXECUTION}/execution.yaml"
INPUTS = f"{EXECUTION}/inputs.json"
"""Of a campaign on one machine: checksums of the inputs that all runs share."""
REPLAY = f"{EXECUTION}/replay.json"
"""Of a replay: how it compares with the run that it repeats."""
INDEX = f"{EXECUTION}/index.json"
SEARCH = f"{EXECUTION}/search"
"""Of a search: what its batches proposed, and their scores."""
COLUMNAR_TABLES = f"{EXECUTION}/tables.duckdb"
RUNS_TABLE = f"{EXECUTION}/runs.duckdb"
"""Of a campaign on a cluster: the row of each run, without tables of the runs' own files."""
SQLITE_TABLES = f"{EXECUTION}/data.db"
POSTPROCESSING = "postprocessing.yaml"
"""Provenance of generated files, in each run's folder and in `_transient`."""

VARIANT_RECORD = f"{CONFIG}/config.yaml"
"""This and the following paths are relative to a variant's folder."""
SCENARIO_CONFIG = f"{CONFIG}/scenario.config"

SYSINFO = "sysinfo.yaml"
"""This and the following paths are relative to a job's folder."""
LOGS = "logs"
SYSTEM_LOG = f"{LOGS}/system.log"

RUNNING = ".running"
"""Folder of runs that are under way, in the campaign's folder."""
STAGE = ".download"
"""Folder of unfinished downloads, in the campaign's folder."""
ASIDE = ".aside"
"""Folder of what has been replaced, in the campaign's folder."""

RUN_RECORD = "run.json"
"""This and the following paths are relative to a run's folder."""
JOB_LINK = "job"
"""Link from a run's folder to the folder of the job that executed it."""
OWN_NAMES = (RUN_RECORD, JOB_LINK)
"""Names in a run's folder that the run did not write itself."""


@dataclass(frozen=True)
class Layout:
    """Paths of one campaign."""

    root: Path
    """The campaign's folder."""

    @property
    def config(self) -> Path:
        """Copy of all inputs of the campaign."""
        return self.root / CONFIG

    @property
    def documents(self) -> list[Path]:
        """The `.vast` files among the inputs, by name."""
        found = names(self.config, self.config)
        return [self.config / name for name in found if name.endswith(".vast")]

    @property
    def execution(self) -> Path:
        """Records of the campaign's execution."""
        return self.root / EXECUTION

    @property
    def transient(self) -> Path:
        """Generated intermediate files."""
        return self.root / TRANSIENT

    @property
    def configurations(self) -> Path:
        """Record of all variants."""
        return self.root / CONFIGURATIONS

    @property
    def execution_record(self) -> Path:
        """Record of when and how the campaign was executed."""
        return self.root / EXECUTION_RECORD

    def batch(self, number: int, part: str = "") -> Path:
        """A file of a search: what a batch proposed; its `.again` or its `.result`."""
        return self.root / SEARCH / f"batch-{number:04d}{part}.json"

    @property
    def jobs(self) -> Path:
        """Output of the jobs, apart from their runs."""
        return self.root / JOBS

    @property
    def running(self) -> Path:
        """Work folders of jobs in progress."""
        return self.root / RUNNING

    @property
    def aside(self) -> Path:
        """Unexpected content that was found in the places of runs."""
        return self.root / ASIDE

    def job(self, name: str) -> Path:
        """A job's own output: system information, logs, resource usage."""
        return self.jobs / name

    def variant(self, name: str) -> Path:
        """Folder of a variant."""
        return self.root / name

    def variant_config(self, name: str) -> Path:
        """Inputs of this variant only."""
        return self.root / name / CONFIG

    def run(self, path: str) -> Path:
        """Folder of a run, by `<variant>/<number>`."""
        return self.root / path

    def run_folders(self) -> Iterator[Path]:
        """Folders of all stored runs, sorted by variant and number."""
        for variant in _folders(self.root):
            if is_variant(variant):
                yield from self.run_folders_of(variant)

    def run_folders_of(self, variant: str) -> list[Path]:
        """Folders of a variant's stored runs, sorted by number."""
        folder = self.variant(variant)
        return [folder / name for name in sorted(filter(is_run_number, _folders(folder)), key=int)]

    def misnumbered_runs(self) -> Iterator[str]:
        """`<variant>/<name>` of folders with a report whose names are numbers that no run has."""
        for variant in filter(is_variant, _folders(self.root)):
            for name in _folders(self.variant(variant)):
                folder = self.variant(variant) / name
                is_number = name.isdecimal() and not is_run_number(name)
                if is_number and any(
                    map(os.path.lexists, (folder / TEST_RESULT, folder / RUN_RECORD))
                ):
                    yield f"{variant}/{name}"


def is_variant(name: str) -> bool:
    """Whether a variant's folder can have this name."""
    return not name.startswith(("_", ".")) and is_printable(name)


def parameters_key(job: str) -> str:
    """Key of a job's parameters; on a cluster, the pod that creates the object owns the name."""
    return f"{TRANSIENT}/{job}.params.yaml"


def job_link_target(job: str) -> Path:
    """Target of the link `job` in a run's folder."""
    return Path("..", "..", JOBS, job)


def job_folder(run: Path) -> Path | None:
    """The folder of the job that executed a stored run, or None.

    A link may contain a path of another machine; then only its end counts, and the folder is
    always taken from `_jobs` of the run's own campaign.
    """
    try:
        parts = Path(os.readlink(run / JOB_LINK)).parts
    except OSError:
        return None
    inside = parts[parts.index(JOBS) :] if JOBS in parts else ()
    folder = run.parent.parent.joinpath(*inside)
    usable = len(inside) > 1 and ".." not in inside and is_folder(folder, run.parent.parent)
    return folder if usable else None


def _folders(path: Path) -> list[str]:
    """Names of the subfolders, sorted, without links."""
    with os.scandir(path) as entries:
        return sorted(entry.name for entry in entries if entry.is_dir(follow_symlinks=False))

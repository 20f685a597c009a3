"""Where everything of a campaign is on disk.

```
<name>-YYYY-MM-DD-HHMMSS/
  _config/            the .vast file, the scenario, run files, notebooks
  _execution/         execution.yaml
  _transient/         configurations.yaml, the run contract, job-N.params.yaml, job_links.yaml
  _jobs/job-N/        sysinfo.yaml, logs/system.log, resource_usage_*.csv
  <variant>/_config/  config.yaml, scenario.config, files of this variant
  <variant>/<run>/    test.xml, what the run wrote, run.json, job -> ../../_jobs/job-N
  .running/job-N/     what is being executed; gone when the campaign is over
  .aside/<variant>/<run>   what stood in a run's place and was not understood; nobody reads it
```
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

RUN_RECORD = "run.json"
TEST_RESULT = "test.xml"


@dataclass(frozen=True)
class Layout:
    """Paths of one campaign."""

    root: Path
    """The campaign's folder."""

    @property
    def config(self) -> Path:
        """Copy of everything that the campaign was made from."""
        return self.root / "_config"

    @property
    def execution(self) -> Path:
        """Records of how it was executed."""
        return self.root / "_execution"

    @property
    def transient(self) -> Path:
        """What was generated on the way."""
        return self.root / "_transient"

    @property
    def jobs(self) -> Path:
        """Folder of the jobs' own output."""
        return self.root / "_jobs"

    @property
    def running(self) -> Path:
        """Work folders of jobs that are being executed."""
        return self.root / ".running"

    @property
    def aside(self) -> Path:
        """What stood in a run's place and was not understood."""
        return self.root / ".aside"

    def job(self, name: str) -> Path:
        """A job's own output: system information, logs, resource usage."""
        return self.jobs / name

    def variant(self, name: str) -> Path:
        """Folder of a variant."""
        return self.root / name

    def variant_config(self, name: str) -> Path:
        """Inputs of a variant alone."""
        return self.root / name / "_config"

    def run(self, path: str) -> Path:
        """Folder of a run, by `<variant>/<number>`."""
        return self.root / path

    def run_folders(self) -> Iterator[Path]:
        """Folders of all runs that were stored, sorted by variant and number."""
        for variant in sorted(self.root.iterdir()):
            if variant.is_dir() and not variant.name.startswith(("_", ".")):
                yield from self.run_folders_of(variant.name)

    def run_folders_of(self, variant: str) -> list[Path]:
        """Folders of a variant's runs that were stored, sorted by number."""
        numbers = (path for path in self.variant(variant).iterdir() if path.name.isdigit())
        return sorted(numbers, key=lambda path: int(path.name))

"""What tests of local execution share: small campaigns, and an observer that remembers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from robovast.campaign.decisions import describe_decision
from robovast.campaign.run_record import RunRecord
from robovast.execution.local import ExecutionSummary, LocalOptions, resume_campaign, run_campaign
from robovast.execution.local.pack_queue import Decided
from robovast.execution.local.process_environment import process_environment
from robovast.model.document import load_document
from robovast.model.plan import Run

ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "configs" / "examples"

HEADER = """\
import osc.helpers

scenario test:
    x: int = 1
    text: string = "a"
    here: common
    do serial:
"""

DOCUMENT = """\
version: 1
metadata: {name: test_campaign}
configuration:
- name: one
  variations:
  - ParameterVariationList: {name: x, values: [1, 2, 3]}
execution:
  scenario_file: scenario.osc
  run_files: ['files/*']
"""


AS_NEEDED = "  runs: {min: 2, max: 4, decide: {good: 0.1, bad: 0.6, error: 0.1}}\n"
SOUND_BROKEN_MIXED = """\
number=$(basename "$3")
echo "$1,$number" > "$3/out.csv"
case $1 in
1) exit 0 ;;
2) exit 1 ;;
3) exit $((number % 2)) ;;
esac
"""
"""One configuration passes, the next fails, and the third does either in turn."""
DECISIONS = "1 passing after 3, 1 failing after 2, 1 inconclusive at 4; 9 of 12 runs needed"


class Recorder:
    """Remembers what a campaign told it."""

    def __init__(self, on_finished: Callable[[Run], None] | None = None) -> None:
        self.messages: list[str] = []
        self.finished: list[str] = []
        self.started: list[str] = []
        self.decided: dict[str, str] = {}
        self.done_before = 0
        self._on_finished = on_finished

    def campaign_started(self, campaign: Path, total: int, done: int, how: str) -> None:
        self.done_before = done

    def runs_added(self, count: int) -> None: ...

    def run_started(self, run: Run) -> None:
        self.started.append(run.path)

    def run_finished(self, run: Run, record: RunRecord) -> None:
        self.finished.append(run.path)
        if self._on_finished:
            self._on_finished(run)

    def configuration_decided(self, decided: Decided) -> None:
        self.decided[decided.variant] = describe_decision(decided.decision)

    def message(self, text: str) -> None:
        self.messages.append(text)


def make_campaign(
    folder: Path, script: str, extra: str = "", document: str = DOCUMENT, command: str = "bash"
) -> Path:
    """A .vast file whose scenario executes a script with `x`, `text` and the output folder."""
    (folder / "files").mkdir(parents=True)
    (folder / "files" / "step.sh").write_text(script)
    call = (
        f'        run_process("{command} " + here.get_scenario_file_directory() + "/files/step.sh"'
        ' + " %s" % x + " %s" % text + " " + here.get_output_directory())\n'
    )
    (folder / "scenario.osc").write_text(HEADER + call)
    path = folder / "test.vast"
    path.write_text(document + extra)
    return path


def run(
    path: Path, output: Path, observer: Recorder | None = None, **options: Any
) -> ExecutionSummary:
    """Execute a new campaign, as plain processes unless told otherwise."""
    chosen = LocalOptions(**{"runtime": "process", **options})
    return run_campaign(load_document(path), output, chosen, observer or Recorder())


def ros_environment() -> str:
    """Folder of the environment with ROS 2 and MuJoCo for plain processes; made once."""
    command = [str(ROOT / "scripts" / "ros-environment")]
    from robovast_testbed import cache  # programs that tests start have no path to it

    environment = {**os.environ, "PYTHON": sys.executable, "XDG_CACHE_HOME": str(cache.root())}
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout.strip()


def resume(campaign: Path, observer: Recorder | None = None, **options: Any) -> ExecutionSummary:
    """Continue a campaign."""
    chosen = LocalOptions(**{"runtime": "process", **options})
    return resume_campaign(campaign, chosen, observer or Recorder())


def verdicts(summary: ExecutionSummary) -> dict[str, str]:
    """Verdict by run, as the stored records say."""
    return {
        f"{record.variant}/{record.run}": json.loads(
            (summary.campaign / record.variant / str(record.run) / "run.json").read_text()
        )["verdict"]
        for record in summary.records
    }


def other_environment(cache: Path) -> Path:
    """Link the environment of this machine's processes as `other` in an empty user's cache."""
    other = cache / "robovast" / "other"
    other.parent.mkdir(parents=True)
    other.symlink_to(process_environment(lambda _: None))
    return other

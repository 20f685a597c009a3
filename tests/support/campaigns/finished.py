"""Finished campaigns for tests, written without executing anything."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import yaml

NAME = "camp-2026-01-01-000000"
DOCUMENT = """\
version: 1
configuration: [{name: c}]
execution: {scenario_file: s.osc}
"""
TEST_XML = """\
<testsuite errors="0" failures="0" tests="1" time="1.5"><testcase name="s"><properties>
<property name="start_time" value="1772634122.5"/></properties></testcase></testsuite>
"""


def finished_campaign(
    results: Path,
    runs: int,
    postprocessing: str = "",
    plugins: str = "",
    *,
    name: str = NAME,
    runs_per_variant: int = 2,
) -> Path:
    """A campaign whose runs each left `out.csv` with their number; returns its folder.

    Args:
        results: where it goes.
        runs: how many.
        postprocessing: the document's `results_processing`, indented by two.
        plugins: content of `tools/plugins.py`, beside the document.
        name: of the folder.
        runs_per_variant: variants are `c-1`, `c-2`, …
    """
    campaign = results / name
    for folder in ("_config/tools", "_execution", "_transient"):
        (campaign / folder).mkdir(parents=True)
    section = f"results_processing:\n  postprocessing:\n{postprocessing}" if postprocessing else ""
    (campaign / "_config" / "c.vast").write_text(DOCUMENT + section)
    (campaign / "_config" / "tools" / "plugins.py").write_text(plugins)
    variants = []
    for index in range(runs):
        variant, number = f"c-{index // runs_per_variant + 1}", index % runs_per_variant
        if number == 0:
            variants.append({"name": variant, "config": {"x": index}, "_config_name": "c"})
        add_run(campaign, variant, number, index)
    data = {"vast": "c.vast", "scenario_file": "s.osc", "configs": variants}
    (campaign / "_transient" / "configurations.yaml").write_text(yaml.safe_dump(data))
    return campaign


def add_run(campaign: Path, variant: str, number: int, index: int) -> Path:
    """A run as the local runtimes store it; returns its folder."""
    folder = campaign / variant / str(number)
    folder.mkdir(parents=True)
    (campaign / variant / "_config").mkdir(exist_ok=True)
    logs = campaign / "_jobs" / f"job-{index}" / "logs"
    logs.mkdir(parents=True)
    (logs / "system.log").write_text("log\n")
    (folder / "job").symlink_to(f"../../_jobs/job-{index}")
    (folder / "out.csv").write_text(f"v\n{index}\n")
    (folder / "test.xml").write_text(TEST_XML)
    record = {
        "campaign": campaign.name,
        "variant": variant,
        "entry": "c",
        "run": number,
        "id": index,
        "verdict": "passed",
        "reason": "",
        "started_at": "2026-01-01T00:00:00+00:00",
        "finished_at": "2026-01-01T00:00:02+00:00",
        "duration": 2.0,
        "exit_code": 0,
        "attempt": 1,
        "job": f"job-{index}",
        "runtime": "process",
        "image": "",
        "image_digest": "",
        "host": "here",
        "parameters": {"x": index, "text": "a, b"},
        "schema": 1,
    }
    (folder / "run.json").write_text(json.dumps(record, indent=1) + "\n")
    return folder


def as_of_another_tool(campaign: Path) -> None:
    """Take away what only this program writes."""
    for path in campaign.glob("*/*/run.json"):
        path.unlink()
    for path in campaign.glob("*/*/job"):
        path.unlink()
    shutil.rmtree(campaign / "_jobs")

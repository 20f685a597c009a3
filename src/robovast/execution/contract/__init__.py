"""The run contract: the files that every run container finds in its configuration folder.

They run where RoboVAST is not installed: in images of any origin (bash, coreutils, Python 3.8).
The executor puts all of them into one folder, sets the environment that `entrypoint.sh` reads,
and starts `entrypoint.sh`, or `secondary_entrypoint.sh` in a secondary container.
"""

from __future__ import annotations

from pathlib import Path

from robovast.model.naming import CONFIG_MOUNT

CONFIG, OUT = CONFIG_MOUNT.rstrip("/"), "/out"
"""Where a run finds its inputs, these files among them, and leaves its results."""

ENTRYPOINT = "entrypoint.sh"
"""Runs one job in the main container."""
SECONDARY_ENTRYPOINT = "secondary_entrypoint.sh"
"""Runs the pre command in a secondary container until the job has ended."""
COLLECT_SYSINFO = "collect_sysinfo.py"
MONITOR_RESOURCES = "monitor_resources.py"
RUN_SCENARIOS = "run_scenarios.py"

NAMES = (ENTRYPOINT, SECONDARY_ENTRYPOINT, COLLECT_SYSINFO, MONITOR_RESOURCES, RUN_SCENARIOS)


def contract_files() -> list[Path]:
    """Return the files of the contract, all of which belong into one folder."""
    return [Path(__file__).with_name(name) for name in NAMES]

"""What this job varies, for the programs that are not the scenario."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import yaml

FOLDER = Path(os.environ.get("ROBOVAST_CONFIG_DIR", "/config"))


def parameters() -> dict[str, Any]:
    """The scenario's parameters; a job has one run, so there is one document."""
    (values,) = yaml.safe_load(
        (FOLDER / os.environ["SCENARIO_PARAMETER_FILE"]).read_text()
    ).values()
    return values


def pose_arguments(pose: dict[str, Any]) -> dict[str, str]:
    """A pose as launch files and `ros_gz_sim create` take it [m, rad]."""
    position, yaw = pose["position"], pose.get("orientation", {}).get("yaw", 0.0)
    return {"x": str(position["x"]), "y": str(position["y"]), "yaw": str(yaw)}

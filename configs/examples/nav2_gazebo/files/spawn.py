#!/usr/bin/env python3
"""Put the obstacles of this run into the world."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from typing import Any

from job import parameters, pose_arguments


def main() -> int:
    """Exit code 0 when every obstacle is there."""
    return max((spawn(one) for one in parameters().get("obstacles", [])), default=0)


def spawn(obstacle: dict[str, Any]) -> int:
    """Put one obstacle into the world; the exit code of what does."""
    with tempfile.NamedTemporaryFile("w", suffix=".sdf") as model:
        model.write(expanded(obstacle))
        model.flush()
        pose = pose_arguments(obstacle["spawn_pose"])
        options = ["-world", "floor_plan", "-name", obstacle["entity_name"], "-file", model.name]
        options += ["-x", pose["x"], "-y", pose["y"], "-Y", pose["yaw"]]
        command = ["ros2", "run", "ros_gz_sim", "create", *options]
        return subprocess.run(command, check=False).returncode


def expanded(obstacle: dict[str, Any]) -> str:
    """The obstacle's model with its arguments filled in."""
    arguments = obstacle["xacro_arguments"].replace(",", " ").split()
    command = ["xacro", obstacle["model"].removeprefix("file://"), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


if __name__ == "__main__":
    sys.exit(main())

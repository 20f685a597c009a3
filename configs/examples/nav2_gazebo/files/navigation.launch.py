"""Nav2 with its own parameters, on the map of the floor plan."""

from __future__ import annotations

import sys
from pathlib import Path

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

sys.path.insert(0, str(Path(__file__).parent))

from job import FOLDER, parameters


def generate_launch_description() -> LaunchDescription:
    bringup = PathJoinSubstitution(
        [FindPackageShare("nav2_bringup"), "launch", "bringup_launch.py"]
    )
    arguments = {
        "map": str(FOLDER / parameters()["map_file"]),
        "use_sim_time": "True",
        "autostart": "True",
    }
    return LaunchDescription(
        [
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(bringup), launch_arguments=arguments.items()
            )
        ]
    )

"""Gazebo without a window, with the walls of the floor plan and a TurtleBot 4 at the start."""

from __future__ import annotations

import sys
from pathlib import Path

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import Command, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

sys.path.insert(0, str(Path(__file__).parent))

from job import FOLDER, parameters, pose_arguments


def generate_launch_description() -> LaunchDescription:
    values = parameters()
    pose = pose_arguments(values["start_pose"])
    return LaunchDescription(
        [
            include(
                "ros_gz_sim",
                "gz_sim.launch.py",
                gz_args=f"-r -s -v2 --headless-rendering {world(values)}",
            ),
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                parameters=[{"use_sim_time": True, "robot_description": description()}],
            ),
            include(
                "nav2_minimal_tb4_sim",
                "spawn_tb4.launch.py",
                use_sim_time="True",
                robot_name="turtlebot4",
                x_pose=pose["x"],
                y_pose=pose["y"],
                yaw=pose["yaw"],
            ),
        ]
    )


def world(values: dict) -> Path:
    """The world with this run's mesh."""
    template = Path(__file__).with_name("floor_plan.sdf").read_text()
    made = Path("/tmp/floor_plan.sdf")  # noqa: S108  # the container's own
    made.write_text(template.replace("MESH_FILE", f"file://{FOLDER / values['mesh_file']}"))
    return made


def description() -> ParameterValue:
    """The robot's URDF."""
    model = PathJoinSubstitution(
        [
            FindPackageShare("nav2_minimal_tb4_description"),
            "urdf/standard/turtlebot4.urdf.xacro",
        ]
    )
    return ParameterValue(Command(["xacro ", model]), value_type=str)


def include(package: str, name: str, **arguments: str) -> IncludeLaunchDescription:
    path = PathJoinSubstitution([FindPackageShare(package), "launch", name])
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(path), launch_arguments=arguments.items()
    )

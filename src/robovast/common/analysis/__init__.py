"""Reading results in notebooks, as pandas data frames (extra `analysis`)."""

from robovast.analysis.notebooks import (
    calculate_speeds_from_poses,
    common,
    for_each_run,
    get_bag_info,
    get_behavior_info,
    get_factors,
    get_run_status,
    get_scenario_parameter,
    print_bag_topics,
    read_output_csv,
    read_output_files,
    read_output_yaml_list,
    read_run_statuses,
    ros2,
)

__all__ = [
    "calculate_speeds_from_poses",
    "common",
    "for_each_run",
    "get_bag_info",
    "get_behavior_info",
    "get_factors",
    "get_run_status",
    "get_scenario_parameter",
    "print_bag_topics",
    "read_output_csv",
    "read_output_files",
    "read_output_yaml_list",
    "read_run_statuses",
    "ros2",
]

"""Functions to read results in notebooks."""

from robovast.analysis.notebooks.common import (
    calculate_speeds_from_poses,
    for_each_run,
    get_behavior_info,
    get_run_status,
    get_scenario_parameter,
    read_output_csv,
    read_output_files,
    read_output_yaml_list,
    read_run_statuses,
)

__all__ = [
    "calculate_speeds_from_poses",
    "for_each_run",
    "get_behavior_info",
    "get_run_status",
    "get_scenario_parameter",
    "read_output_csv",
    "read_output_files",
    "read_output_yaml_list",
    "read_run_statuses",
]

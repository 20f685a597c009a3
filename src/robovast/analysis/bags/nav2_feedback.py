"""Feedback types of Nav2's actions from Humble to Jazzy, whose bags do not define them."""

_DISTANCE = "float32 distance_traveled"
_NAVIGATION = """\
geometry_msgs/PoseStamped current_pose
builtin_interfaces/Duration navigation_time
builtin_interfaces/Duration estimated_time_remaining
int16 number_of_recoveries
float32 distance_remaining
"""

FEEDBACK = {
    "nav2_msgs/action/AssistedTeleop": "builtin_interfaces/Duration current_teleop_duration",
    "nav2_msgs/action/BackUp": _DISTANCE,
    "nav2_msgs/action/DriveOnHeading": _DISTANCE,
    "nav2_msgs/action/FollowPath": "float32 distance_to_goal\nfloat32 speed",
    "nav2_msgs/action/FollowWaypoints": "uint32 current_waypoint",
    "nav2_msgs/action/NavigateThroughPoses": _NAVIGATION + "int16 number_of_poses_remaining",
    "nav2_msgs/action/NavigateToPose": _NAVIGATION,
    "nav2_msgs/action/Spin": "float32 angular_distance_traveled",
    "nav2_msgs/action/Wait": "builtin_interfaces/Duration time_left",
}
"""Fields by action."""

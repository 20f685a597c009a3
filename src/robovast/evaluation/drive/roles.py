"""Which topic of a recording tells what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from robovast.analysis.bags.behaviors import TREE_TYPE

ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
ESTIMATE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
SCAN = "sensor_msgs/msg/LaserScan"
PLAN = "nav_msgs/msg/Path"
MAP = "nav_msgs/msg/OccupancyGrid"
FOOTPRINT = "geometry_msgs/msg/PolygonStamped"
PICTURE = "sensor_msgs/msg/CompressedImage"
LOG = "rcl_interfaces/msg/Log"
TREE_LOG = "nav2_msgs/msg/BehaviorTreeLog"

MOVING = "/tf"
FIXED = "_static"
"""End of the name of a topic with fixed transforms."""


@dataclass(frozen=True)
class Role:
    """What a topic can tell."""

    what: str
    types: tuple[str, ...]
    """Message types that can be shown, the best first."""
    names: tuple[str, ...]
    """Usual names, the best first."""
    only_named: bool = False
    """Whether another topic of such a type is never guessed."""


ROLES: Mapping[str, Role] = {
    "pose": Role(
        "the robot's pose",
        (ODOMETRY, ESTIMATE, POSE, TRANSFORMS),
        ("/odom", "/odometry/filtered", "/odometry", "/amcl_pose", MOVING),
    ),
    "scan": Role("the laser", (SCAN,), ("/scan", "/scan_filtered", "/front/scan")),
    "plan": Role("the planned path", (PLAN,), ("/plan", "/global_plan", "/path")),
    "map": Role("the map", (MAP,), ("/map",), only_named=True),
    "footprint": Role(
        "the footprint",
        (FOOTPRINT,),
        ("/local_costmap/published_footprint", "/global_costmap/published_footprint"),
        only_named=True,
    ),
    "camera": Role(
        "the camera",
        (PICTURE,),
        (
            "/camera/image/compressed",
            "/camera/image_raw/compressed",
            "/camera/color/image_raw/compressed",
            "/image_raw/compressed",
        ),
    ),
    "tree": Role("the behavior tree", (TREE_TYPE, TREE_LOG), ("/behavior_tree_log",)),
    "log": Role("log messages", (LOG,), ("/rosout",)),
}
"""The keys of `evaluation.player` that name topics."""


@dataclass
class Cast:
    """Topics by role."""

    topics: dict[str, str] = field(default_factory=dict)
    transforms: str = MOVING
    """Topic of the transforms; fixed ones are on a topic of this name with `_static`."""
    missing: list[str] = field(default_factory=list)
    """What was named and cannot be shown, and what a drive is nothing without."""


def cast(types: Mapping[str, str], named: Mapping[str, str]) -> Cast:
    """Choose a topic for each role.

    Args:
        types: message type of each topic.
        named: topics by role that the document names; others are guessed.
    """
    found = Cast()
    for key, role in ROLES.items():
        if key in named:
            topic = "/" + named[key].lstrip("/")
            fault = _fault(key, role, topic, types)
            if fault:
                found.missing.append(fault)
            else:
                found.topics[key] = topic
        elif guess := _guess(role, types):
            found.topics[key] = guess
        elif key in ("pose", "scan"):
            usual = next((name for name in role.names if name in types and name != MOVING), None)
            other = usual and _fault(key, role, usual, types)
            found.missing.append(other or _unknown(role, types))
    found.transforms = _transforms(types, found.topics.get("pose", ""))
    return found


def _transforms(types: Mapping[str, str], pose: str) -> str:
    """The topic of the transforms: of the namespaces with one, the longest that has the pose."""
    if types.get(pose) == TRANSFORMS:
        return pose
    every = {name.removesuffix(FIXED) for name in types if types[name] == TRANSFORMS}
    spaces = {name.removesuffix("tf") for name in every if name.endswith(MOVING)}
    fitting = sorted(
        spaces, key=lambda space: (-len(space) if pose.startswith(space) else 0, space)
    )
    return f"{fitting[0]}tf" if fitting else MOVING


def _guess(role: Role, types: Mapping[str, str]) -> str | None:
    usual = [name for name in role.names if types.get(name) in role.types]
    if usual or role.only_named:
        return next(iter(usual), None)
    fitting = [name for name in types if types[name] in role.types and not name.endswith(FIXED)]
    return min(fitting, key=lambda name: (role.types.index(types[name]), name), default=None)


def _fault(key: str, role: Role, topic: str, types: Mapping[str, str]) -> str:
    """Why a topic cannot be shown; empty if it can."""
    if topic not in types:
        return (
            f"Without {role.what}: `evaluation.player.{key}` names {topic}, which was not "
            f"recorded. Recorded were {_listed(types)}."
        )
    if types[topic] not in role.types:
        return (
            f"Without {role.what}: {topic} has messages of type {types[topic]}; the player reads "
            f"{' and '.join(role.types)}. `evaluation.player.{key}` may name another topic."
        )
    return ""


def _unknown(role: Role, types: Mapping[str, str]) -> str:
    return (
        f"Without {role.what}: no topic has messages of type {' or '.join(role.types)}. "
        f"Recorded were {_listed(types)}."
    )


def _listed(types: Mapping[str, str]) -> str:
    names = sorted(types)
    return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")

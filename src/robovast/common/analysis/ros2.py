"""Content of recorded bags, for notebooks."""

from robovast.analysis.notebooks.ros2 import get_bag_info, print_bag_topics

__all__ = ["get_bag_info", "print_bag_topics"]

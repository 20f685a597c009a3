"""Drawing on maps, where notebooks look for it."""

from robovast.compat.map_visualizer import MapVisualizer

__all__ = ["MapVisualizer"]

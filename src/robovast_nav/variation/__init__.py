"""The navigation variation types."""

from robovast.navigation.floorplan_variation import FloorplanGeneration, FloorplanVariation
from robovast.navigation.obstacle_variation import (
    ObstacleVariation,
    ObstacleVariationWithDistanceTrigger,
)
from robovast.navigation.path_variation import PathVariationRandom, PathVariationRasterized

__all__ = [
    "FloorplanGeneration",
    "FloorplanVariation",
    "ObstacleVariation",
    "ObstacleVariationWithDistanceTrigger",
    "PathVariationRandom",
    "PathVariationRasterized",
]

"""Navigation variation types, where plugins look for them."""

from robovast.navigation.obstacle_variation import ObstacleVariationWithDistanceTrigger

__all__ = ["ObstacleVariationWithDistanceTrigger"]

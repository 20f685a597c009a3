"""Navigation variation types, where plugins look for them."""

from robovast.navigation.obstacle_variation import ObstacleVariation

__all__ = ["ObstacleVariation"]

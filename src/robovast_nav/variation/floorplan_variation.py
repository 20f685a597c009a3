"""Navigation variation types, where plugins look for them."""

from robovast.navigation.floorplan_variation import FloorplanGeneration, FloorplanVariation

__all__ = ["FloorplanGeneration", "FloorplanVariation"]

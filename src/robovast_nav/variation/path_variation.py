"""Navigation variation types, where plugins look for them."""

from robovast.navigation.path_variation import PathVariationRandom, PathVariationRasterized

__all__ = ["PathVariationRandom", "PathVariationRasterized"]

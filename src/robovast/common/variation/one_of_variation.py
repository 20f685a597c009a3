"""OneOfVariation, for plugins."""

from robovast.model.variations.one_of_variation import OneOfVariation

__all__ = ["OneOfVariation"]

"""The base class of variation types, for plugins."""

from robovast.model.variations.base_variation import ProvContribution, Variation

__all__ = ["ProvContribution", "Variation"]

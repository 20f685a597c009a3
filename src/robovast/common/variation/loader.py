"""Finds variation types by name, for plugins."""

from robovast.model.variations.loader import load_variation

__all__ = ["load_variation"]

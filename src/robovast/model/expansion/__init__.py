"""Expansion of a document's configuration entries into variants."""

from robovast.model.expansion.expand import Composition, compose, expand
from robovast.model.expansion.select import (
    Selection,
    patterns_of,
    select_any,
    select_variants,
)
from robovast.model.variant import ConfigFile, Variant, VariationRecord

__all__ = [
    "Composition",
    "ConfigFile",
    "Selection",
    "Variant",
    "VariationRecord",
    "compose",
    "expand",
    "patterns_of",
    "select_any",
    "select_variants",
]

"""Expansion of a document's configuration entries into variants."""

from robovast.expansion.expand import expand
from robovast.expansion.select import select_variants
from robovast.expansion.variant import ConfigFile, Variant, VariationRecord

__all__ = ["ConfigFile", "Variant", "VariationRecord", "expand", "select_variants"]

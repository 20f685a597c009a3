"""The base class of metadata processors, for plugins."""

from robovast.analysis.provenance.processor import MetadataProcessor

__all__ = ["MetadataProcessor"]

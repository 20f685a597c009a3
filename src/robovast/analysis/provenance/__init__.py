"""Describes campaigns: metadata.yaml, a PROV-O graph, and answers to SPARQL queries."""

from robovast.analysis.provenance.writing import (
    PluginFaultsError,
    describe,
    write_graph,
    write_metadata,
)

__all__ = ["PluginFaultsError", "describe", "write_graph", "write_metadata"]

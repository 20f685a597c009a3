"""Fixtures of the tests on a real cluster."""

from cluster_lab import installed, lab

__all__ = ["installed", "lab"]

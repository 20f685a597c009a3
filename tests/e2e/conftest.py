"""Fixtures of the tests on a real cluster."""

from support.kube.lab import installed, lab

__all__ = ["installed", "lab"]

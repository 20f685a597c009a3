"""Fixtures of the tests with other projects."""

from support.kube.lab import installed, lab

__all__ = ["installed", "lab"]

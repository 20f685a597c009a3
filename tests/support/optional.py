"""Packages of extras that tests need."""

import os

import pytest


def needs(package: str) -> None:
    """Skip a module where a package is missing; in CI that is a failure."""
    if os.environ.get("CI") != "true":
        pytest.importorskip(package)

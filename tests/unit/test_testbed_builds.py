"""Programs that the testbed builds have the plugins that it uses, and no others."""

from __future__ import annotations

from pathlib import Path

import pytest
from robovast_testbed.errors import Unavailable
from robovast_testbed.gobuild import leave_out

REGISTRY = """package plugin

import (
	// Include all plugins.
	_ "example.org/dns/plugin/azure"
	_ "example.org/dns/plugin/cache"
	_ "example.org/dns/plugin/ready"
)
"""


@pytest.fixture
def registry(tmp_path: Path) -> Path:
    file = tmp_path / "plugins.go"
    file.write_text(REGISTRY)
    return file


def test_other_plugins_are_left_out(registry: Path) -> None:
    leave_out(registry, ("cache", "ready"))
    assert registry.read_text() == REGISTRY.replace('\t_ "example.org/dns/plugin/azure"\n', "")


def test_a_plugin_that_a_new_release_lacks_is_named(registry: Path) -> None:
    with pytest.raises(Unavailable, match=r"plugins\.go imports no plugin kubernetes"):
        leave_out(registry, ("cache", "kubernetes"))
    assert registry.read_text() == REGISTRY

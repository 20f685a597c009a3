"""What runs of a cluster that are taken over must have in common."""

from __future__ import annotations

import platform
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support.campaigns.local import make_campaign

from robovast.agent.reuse import key_parts
from robovast.model.document import load_document
from robovast.model.scenario import read_scenario


def test_runs_of_another_architecture_are_other_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A digest may be that of a list of images, one for each."""
    document = load_document(make_campaign(tmp_path, "true", "  seed: 7\n"))
    plan = SimpleNamespace(image=f"registry/image@sha256:{'0' * 64}", cluster=None)
    campaign: Any = SimpleNamespace(plan=plan)
    found = set()
    for machine in ("x86_64", "aarch64"):
        monkeypatch.setattr(platform, "machine", lambda machine=machine: machine)
        scenario = read_scenario(document.scenario)
        parts = key_parts(campaign, document, scenario, [], {}, tmp_path)
        assert parts is not None
        found.add(parts.common)
    assert len(found) == 2

"""Variation types that need a container while a document is expanded."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support.campaigns.local import make_campaign

from robovast.base.errors import CannotRunError, InputError
from robovast.model.document import load_document
from robovast.model.expansion import compose
from robovast.model.expansion.containers import refuse_containers

DOCUMENT = """\
version: 1
configuration:
- name: one
  variations: [{"plugin.py:Made": {}}]
execution: {scenario_file: scenario.osc}
"""
PLUGIN = """\
from robovast.common.variation import Variation

class Made(Variation):
    @classmethod
    def get_required_container(cls, parameters):
        return %r

    def variation(self, in_configs):
        return [self.update_config(c, {"text": self.container_runner}) for c in in_configs]
"""


def expanded(folder: Path, image: Any, containers: Callable[..., Any]) -> dict[str, Any]:
    """Parameters of the one variant."""
    path = make_campaign(folder / "in", "", document=DOCUMENT)
    (path.parent / "plugin.py").write_text(PLUGIN % (image,))
    (variant,) = compose(load_document(path), folder, containers=containers).variants
    return variant.parameters


def test_a_type_gets_what_starts_its_container(tmp_path: Path) -> None:
    made = expanded(tmp_path, "my/image", lambda image, message: f"starts {image}")
    assert made == {"text": "starts my/image"}


def test_a_type_without_a_container_gets_none(tmp_path: Path) -> None:
    assert expanded(tmp_path, None, refuse_containers) == {"text": None}


def test_a_cluster_says_that_it_starts_none(tmp_path: Path) -> None:
    with pytest.raises(CannotRunError, match=r"`one`, variation `plugin.py:Made`.*my/image"):
        expanded(tmp_path, "my/image", refuse_containers)


def test_a_type_must_name_an_image(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"`one`.*must name an image, not 7"):
        expanded(tmp_path, 7, refuse_containers)

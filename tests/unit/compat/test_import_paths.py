"""Import paths of plugins of the existing tool lead to classes that work here."""

from __future__ import annotations

from pathlib import Path

from robovast.analysis.postprocessing.child import prepare
from robovast.base.plugins import load_plugin
from robovast.common.variation import Variation
from robovast_nav.variation.floorplan_variation import FloorplanVariation
from robovast_nav.variation.obstacle_variation_with_distance_trigger import (
    ObstacleVariationWithDistanceTrigger,
)
from robovast_nav.variation.path_variation import PathVariationRandom

PLUGIN = """\
from robovast.results_processing.postprocessing_plugins import BasePostprocessingPlugin


class Copy(BasePostprocessingPlugin):
    def __call__(self, results_dir, config_dir, text="", **kwargs):
        return True, f"{results_dir} {config_dir} {text} {sorted(kwargs)}"
"""


def test_variation_types_have_their_paths() -> None:
    for kind in (FloorplanVariation, ObstacleVariationWithDistanceTrigger, PathVariationRandom):
        assert issubclass(kind, Variation)


def test_a_postprocessing_command_may_be_a_class(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(PLUGIN)
    plugin = load_plugin("own.py:Copy", "robovast.postprocessing_commands", tmp_path)
    request = {"parameters": {"text": "hi"}, "results_dir": "/c", "folder": "/f", "given": {}}
    assert prepare(plugin, request, Path("p.json"))() == (True, "/c /f hi ['provenance_file']")
    assert plugin().get_files_to_copy("/f", {}) == []

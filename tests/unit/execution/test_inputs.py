"""Which files a campaign is made from."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import InputError
from robovast.model.document import load_document
from robovast.model.expansion import compose
from robovast.model.expansion.containers import refuse_containers
from robovast.model.inputs import campaign_files

PLUGIN = """
from robovast.results_processing.postprocessing_plugins import BasePostprocessingPlugin

class Wants(BasePostprocessingPlugin):
    def __call__(self, results_dir, config_dir, **kwargs):
        return True, ""

    def get_files_to_copy(self, config_dir, params):
        return params["files"]
"""
MENTIONS_NOTHING = "raise SystemExit('must not be executed')\n"


def files(folder: Path, command: str) -> set[str]:
    (folder / "a.osc").write_text("scenario drive:\n    do serial:\n        wait elapsed(1s)\n")
    path = folder / "a.vast"
    path.write_text(
        "version: 1\nconfiguration: [{name: t}]\nexecution: {scenario_file: a.osc}\n"
        f"results_processing:\n  postprocessing:\n  - {command}\n"
    )
    (folder / "p.py").write_text(PLUGIN)
    (folder / "q.py").write_text(MENTIONS_NOTHING)
    for name in ("calibration/a.yaml", "calibration/b/c.yaml", "d.yaml"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("")
    document = load_document(path)
    composition = compose(document, folder / "scratch", containers=refuse_containers)
    found = {file.as_posix() for file in campaign_files(document, composition)}
    return found - {"a.osc", "a.vast", "p.py", "q.py"}


@pytest.mark.parametrize(
    ("wanted", "taken"),
    [
        ("[d.yaml, none.yaml]", {"d.yaml"}),
        ("[calibration]", {"calibration/a.yaml", "calibration/b/c.yaml"}),
        ("[]", set()),
    ],
)
def test_a_command_says_which_files_it_wants_beside_the_document(
    tmp_path: Path, wanted: str, taken: set[str]
) -> None:
    assert files(tmp_path, f"p.py:Wants: {{files: {wanted}}}") == taken


@pytest.mark.parametrize("command", ["q.py:function", "not_installed", "rosbags_bt_to_csv"])
def test_a_command_that_says_nothing_is_not_executed(tmp_path: Path, command: str) -> None:
    assert files(tmp_path, command) == set()


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ("{files: [/etc/passwd]}", "names /etc/passwd, which is not in"),
        ("{}", "raised KeyError: 'files'"),
    ],
)
def test_what_a_command_cannot_have_is_said(tmp_path: Path, parameters: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        files(tmp_path, f"p.py:Wants: {parameters}")


VARIATION = """
from robovast.common.variation import Variation

class Reads(Variation):
    def variation(self, in_configs):
        return [self.update_config(config, {}) for config in in_configs]

    def get_input_files(self):
        return ["read.yaml"]

    def get_campaign_transient_files(self):
        return [("made.yaml", self.base_path + "/made.yaml")]
"""


def test_alternatives_have_their_files_in_the_campaign(tmp_path: Path) -> None:
    for name in ("read.yaml", "made.yaml"):
        (tmp_path / name).write_text("")
    (tmp_path / "v.py").write_text(VARIATION)
    (tmp_path / "a.osc").write_text("scenario a:\n    do serial:\n        wait elapsed(1s)\n")
    (tmp_path / "a.vast").write_text(
        "version: 1\nexecution: {scenario_file: a.osc}\nconfiguration:\n- name: t\n  variations:\n"
        "  - OneOfVariation: {variations: [{OneOfVariation: {variations: ['v.py:Reads']}}]}\n"
    )
    document = load_document(tmp_path / "a.vast")
    composition = compose(document, tmp_path / "scratch", containers=refuse_containers)
    found = {file.as_posix() for file in campaign_files(document, composition)}
    assert found == {"a.vast", "a.osc", "v.py", "read.yaml"}
    assert [file.name for file in composition.transient_files] == ["made.yaml"]

"""The folder of a job's inputs: nothing is written outside of it, and no link is followed."""

import os
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robovast.execution.job_config import build_config_folder
from robovast.model.plan import PackStart, Run
from robovast.model.scenario import Scenario
from robovast.model.variant import ConfigFile, Variant

SCENARIO = Scenario("s", ())
PARTS = st.sampled_from(["..", ".", "a", "d", "", "x\0"])


def build(folder: Path, *files: ConfigFile) -> Path:
    common = folder / "common"
    common.mkdir(exist_ok=True)
    made = folder / "jobs" / "config"
    job = PackStart(0, (Run(0, Variant("hall", "hall", {}, files), 0),))
    build_config_folder(made, common, job, SCENARIO)
    return made


def content(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


@settings(max_examples=100, deadline=None)
@given(st.lists(PARTS, min_size=1, max_size=6), st.booleans())
def test_no_name_of_a_file_leads_out(
    tmp_path_factory: pytest.TempPathFactory, parts: list[str], absolute: bool
) -> None:
    root = tmp_path_factory.mktemp("r")
    (root / "source").write_text("x")
    before = {*content(root), "common"}
    name = ("/" if absolute else "") + "/".join(parts)
    with suppress(OSError):
        build(root, ConfigFile(name, root / "source"))
    assert {name for name in content(root) - before if not name.startswith("jobs")} == set()


def test_a_source_that_is_a_link_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("secret")
    (tmp_path / "link").symlink_to(tmp_path / "secret")
    with pytest.raises(OSError, match="is a link"):
        build(tmp_path, ConfigFile("a", tmp_path / "link"))


def test_a_file_replaces_a_shared_one_of_its_name_without_changing_that(tmp_path: Path) -> None:
    (tmp_path / "common").mkdir()
    shared = tmp_path / "common" / "map.yaml"
    shared.write_text("shared")
    own = tmp_path / "own"
    own.write_text("own")
    os.chmod(own, 0o700)
    made = build(tmp_path, ConfigFile("map.yaml", own), ConfigFile("deep/map.yaml", own))
    assert ((made / "map.yaml").read_text(), shared.read_text()) == ("own", "shared")
    assert os.access(made / "deep" / "map.yaml", os.X_OK)

"""Continuing campaigns of others: nothing outside of a campaign is read or written."""

from __future__ import annotations

import json
import os
import shutil
import tarfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.campaigns.local import Recorder, make_campaign, resume, run

from robovast.base.errors import CannotRunError, DocumentError, RobovastError
from robovast.campaign.imported import MARK, is_imported
from robovast.campaign.importing import import_archive
from robovast.campaign.merge import merge_campaigns
from robovast.execution.compat import COMPAT_VERSION
from robovast.execution.local import LocalOptions, replay_run
from robovast.execution.local.replay import find_run
from robovast.model.document import load_document
from robovast.search import local as search

OWN = "key of the user\n"


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign of three runs, two of which are missing."""
    folder = tmp_path_factory.mktemp("executed")
    campaign = run(make_campaign(folder / "in", "exit 0\n"), folder / "out").campaign
    for name in ("one-2", "one-3"):
        shutil.rmtree(campaign / name / "0")
    return campaign


def packed(campaign: Path, folder: Path, change: Callable[[Path], None]) -> Path:
    """An archive of a copy of a campaign that somebody has changed."""
    copy = folder / "made" / campaign.name
    shutil.copytree(campaign, copy, symlinks=True)
    change(copy)
    archive = folder / "campaign.tar.gz"
    with tarfile.open(archive, "w:gz") as tar:
        tar.add(copy, copy.name)
    return archive


def with_files(*names: Any) -> Callable[[Path], None]:
    """Lists files of the missing runs' configurations."""

    def change(campaign: Path) -> None:
        path = campaign / "_transient" / "configurations.yaml"
        data = yaml.safe_load(path.read_text())
        for item in data["configs"][1:]:
            item["_config_files"] = list(names)
        path.write_text(yaml.safe_dump(data))
        deep = campaign / "deep/1/2/3/4/5/6"
        deep.mkdir(parents=True)
        (campaign / "deep/.ssh").mkdir()
        (campaign / "deep/.ssh/authorized_keys").write_text("stolen\n")
        (campaign / "one-2/_config/d").symlink_to("../../deep/1/2/3/4/5/6")
        (campaign / "one-2/_config/link").symlink_to("../../deep/.ssh/authorized_keys")

    return change


def linked(name: str) -> Callable[[Path], None]:
    """Puts a link to another folder of the campaign in the place of one that is written to."""

    def change(campaign: Path) -> None:
        shutil.rmtree(campaign / name, ignore_errors=True)
        (campaign / name).parent.mkdir(exist_ok=True)
        (campaign / name).symlink_to(
            os.path.relpath(campaign / "_config", (campaign / name).parent)
        )

    return change


ESCAPES = {
    "up": with_files("d/../../../../../../.ssh/authorized_keys"),
    "absolute": with_files("/etc/passwd"),
    "pair": with_files(["../x", "/etc/passwd"]),
    "behind a link": with_files("d/keep"),
    "link": with_files("link"),
    **{name: linked(name) for name in ("_jobs", "_transient", "_execution", ".aside")},
    **{name: linked(name) for name in ("one-2", "one-2/_config", "_config/x")},
}


@pytest.mark.parametrize("change", ESCAPES.values(), ids=ESCAPES)
def test_continuing_leaves_everything_else_alone(
    executed: Path, tmp_path: Path, change: Callable[[Path], None]
) -> None:
    home = tmp_path / "home"
    (home / ".ssh").mkdir(parents=True)
    (home / ".ssh" / "authorized_keys").write_text(OWN)
    archive = packed(executed, tmp_path, change)
    try:
        campaign = import_archive(archive, home / "results")
    except RobovastError:
        return
    inputs = {path: path.read_bytes() for path in (campaign / "_config").rglob("*.*")}
    with pytest.raises(RobovastError):
        resume(campaign)
    assert (home / ".ssh" / "authorized_keys").read_text() == OWN
    assert sorted(path.name for path in home.iterdir()) == [".ssh", "results"]
    assert {path: path.read_bytes() for path in (campaign / "_config").rglob("*.*")} == inputs


@pytest.mark.parametrize("name", [".running", ".running/common"])
def test_links_in_another_machines_notes_stay_outside(
    executed: Path, tmp_path: Path, name: str
) -> None:
    campaign = import_archive(packed(executed, tmp_path, linked(name)), tmp_path / "results")
    assert not os.path.lexists(campaign / ".running")


def test_an_archive_neither_brings_nor_removes_the_mark(executed: Path, tmp_path: Path) -> None:
    def change(campaign: Path) -> None:
        (campaign / MARK).mkdir()
        (campaign / MARK / "x").touch()

    assert not is_imported(executed)
    for number, spoil in enumerate((change, lambda _: None)):
        folder = tmp_path / f"{number}"
        folder.mkdir()
        campaign = import_archive(packed(executed, folder, spoil), folder / "results")
        assert (campaign / MARK).is_file()
        merged = folder / "merged-2026-01-01-000000"
        merge_campaigns([campaign], merged)
        assert is_imported(merged)


def test_an_imported_campaign_runs_in_a_container_only(
    executed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its records say `process`; only the user may choose that."""
    monkeypatch.setattr("robovast.execution.local.choose.engine_answers", lambda _: False)
    campaign = import_archive(packed(executed, tmp_path, lambda _: None), tmp_path / "results")
    stored = find_run(campaign / "one-1" / "0")
    assert stored.record.runtime == "process"
    for runtime in ("auto", "same"):
        options = LocalOptions(runtime=runtime)
        with pytest.raises(CannotRunError, match="imported, so its runs need a container"):
            replay_run(stored, tmp_path / "again", 1, options, Recorder())
    with pytest.raises(CannotRunError, match="imported, so its runs need a container"):
        resume(campaign, runtime="auto")
    assert not (tmp_path / "again").exists()
    typed = LocalOptions(runtime="process")
    again = replay_run(stored, tmp_path / "again", 1, typed, Recorder()).campaign
    assert is_imported(again), "its inputs are still those of the archive"
    (campaign / MARK).unlink()
    assert len(resume(campaign, runtime="auto").records) == 3


PLUGIN = "open({!r}, 'w').close()\nclass Own: pass\n"


@pytest.mark.parametrize(
    "section",
    [
        "configuration: [{name: one, variations: [{'evil.py:Own': {}}]}]",
        "configuration: [{name: one}]\nsearch: {strategy: evil.py:Own, extract: evil.py:Own}",
        "configuration: [{name: one}]\nresults_processing: {postprocessing: [evil.py:Own]}",
    ],
)
def test_no_plugin_of_an_imported_campaign_is_loaded(
    executed: Path, tmp_path: Path, section: str
) -> None:
    def change(campaign: Path) -> None:
        text = PLUGIN.format(str(tmp_path / "loaded")) + "# get_files_to_copy\n"
        (campaign / "_config" / "evil.py").write_text(text)
        execution = "execution: {scenario_file: scenario.osc, image: robots/hall}\n"
        (campaign / "_config" / "test.vast").write_text(
            f"version: 1\nmetadata: {{name: test_campaign}}\n{section}\n{execution}"
        )

    campaign = import_archive(packed(executed, tmp_path, change), tmp_path / "results")
    options = LocalOptions(runtime="podman")
    with suppress(RobovastError):
        search.resume(campaign, options, Recorder())
    with suppress(RobovastError):
        replay_run(find_run(campaign / "one-1/0"), tmp_path / "again", 1, options, Recorder())
    assert not (tmp_path / "loaded").exists()


def test_an_unchanged_campaign_continues(executed: Path, tmp_path: Path) -> None:
    campaign = import_archive(packed(executed, tmp_path, lambda _: None), tmp_path / "results")
    assert len(resume(campaign).records) == 3


ENGINE = f"""#!/bin/sh
echo "$*" >> "$0.log"
case "$*" in
  *"entrypoint cat"*) echo {COMPAT_VERSION};;
  "image inspect"*) echo hall@sha256:0;;
  run*) exit 1;;
esac
"""
"""Stands for Docker, and records its command lines."""


@pytest.fixture
def engine_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The command lines of an engine on a machine with a display."""
    docker = tmp_path / "bin" / "docker"
    docker.parent.mkdir()
    docker.write_text(ENGINE)
    docker.chmod(0o755)
    monkeypatch.setenv("PATH", f"{docker.parent}:{os.environ['PATH']}")
    monkeypatch.setenv("DISPLAY", ":7")
    monkeypatch.setattr("robovast.execution.local.container_runtime.X11_SOCKETS", tmp_path)
    return docker.with_name("docker.log")


@pytest.mark.parametrize("is_marked", [True, False])
@pytest.mark.parametrize("gui", [None, True, False])
def test_containers_of_imported_campaigns_are_confined(
    executed: Path, tmp_path: Path, engine_log: Path, is_marked: bool, gui: bool | None
) -> None:
    def change(campaign: Path) -> None:
        document = campaign / "_config" / "test.vast"
        data = yaml.safe_load(document.read_text())
        data["execution"]["run_as_user"] = 0
        document.write_text(yaml.safe_dump(data))

    campaign = import_archive(packed(executed, tmp_path, change), tmp_path / "results")
    if not is_marked:
        (campaign / MARK).unlink()
    options = LocalOptions(runtime="docker", image="robots/hall", gui=gui)
    told = Recorder()
    replay_run(find_run(campaign / "one-1/0"), tmp_path / "again", 1, options, told)
    (started,) = [line for line in engine_log.read_text().splitlines() if "--init" in line]
    assert ("--security-opt=no-new-privileges" in started) is is_marked
    assert ("--user=0:0" in started) is not is_marked
    assert ("DISPLAY" in started) is (not is_marked if gui is None else gui)
    assert any("`execution.run_as_user` is ignored" in one for one in told.messages) is is_marked


@pytest.mark.parametrize("image", ["-v/:/host", "--volume=/:/out/host", "-", "a b"])
def test_an_image_that_is_an_option_never_reaches_the_engine(
    executed: Path, tmp_path: Path, engine_log: Path, image: str
) -> None:
    def change(campaign: Path) -> None:
        record = campaign / "one-1/0/run.json"
        data = json.loads(record.read_text())
        record.write_text(
            json.dumps(data | {"runtime": "docker", "image": image, "image_digest": image})
        )

    campaign = import_archive(packed(executed, tmp_path, change), tmp_path / "results")
    options = LocalOptions(runtime="same")
    with pytest.raises(RobovastError, match="not a valid image name"):
        replay_run(find_run(campaign / "one-1/0"), tmp_path / "again", 1, options, Recorder())
    assert image not in engine_log.read_text()
    text = (campaign / "_config" / "test.vast").read_text()
    data = yaml.safe_load(text)
    data["execution"]["image"] = image
    (tmp_path / "bad.vast").write_text(yaml.safe_dump(data))
    with pytest.raises(DocumentError, match="image"):
        load_document(tmp_path / "bad.vast")

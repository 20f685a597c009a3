"""From a document to a Campaign: what goes along, and how."""

from __future__ import annotations

import base64
import gzip
import io
import re
import tarfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from robovast.base.errors import InputError
from robovast.kubeapi import submission
from robovast.kubeapi.resources import DNS_LABEL, CampaignSpec
from robovast.kubeapi.submission import (
    SubmitOptions,
    campaign_name,
    needs_context,
    prepare_submission,
)
from robovast.model.document import Document, load_document

SCENARIO = """\
import osc.helpers

scenario drive:
    speed: float = 1.0
    do serial:
        wait elapsed(1s)
"""
DOCUMENT = """\
version: 1
metadata: {name: My_Drive}
configuration:
- name: sweep
  variations:
  - tools/double.py:Double: {name: speed}
execution:
  scenario_file: drive.osc
  run_files: ['files/*']
"""
PLUGIN = """\
from robovast.common.variation import Variation

class Double(Variation):
    def variation(self, in_configs):
        self.read = ["maps/hall.yaml"]
        return [self.update_config(c, {"speed": 2.0}) for c in in_configs]

    def get_input_files(self):
        return self.read
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    files = {
        "drive.vast": DOCUMENT,
        "drive.osc": SCENARIO,
        "files/ü.txt": "ü\n",
        "tools/double.py": PLUGIN,
        "maps/hall.yaml": "image: hall.pgm\n",
        "other/unused.txt": "x",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "files/map.png").write_bytes(b"\x89PNG\xff")
    return tmp_path


@pytest.fixture
def document(folder: Path) -> Document:
    return load_document(folder / "drive.vast")


def spec_of(document: Document, options: SubmitOptions | None = None) -> dict[str, Any]:
    made = prepare_submission(document, options or SubmitOptions(), "x")
    spec: dict[str, Any] = made.campaign["spec"]
    CampaignSpec.model_validate(spec)
    return spec


def test_everything_that_a_run_or_a_variation_reads_goes_along(document: Document) -> None:
    inline = spec_of(document)["source"]["inline"]
    assert inline["files"] == {
        "drive.vast": DOCUMENT,
        "drive.osc": SCENARIO,
        "files/ü.txt": "ü\n",
        "tools/double.py": PLUGIN,
        "maps/hall.yaml": "image: hall.pgm\n",
    }
    assert {name: base64.b64decode(data) for name, data in inline["binaryFiles"].items()} == {
        "files/map.png": b"\x89PNG\xff"
    }


def test_only_what_a_user_says_stands_beside_the_document(document: Document) -> None:
    assert set(spec_of(document)) == {"vast", "document", "source"}
    options = SubmitOptions("sweep-*", 3, "img:1", log_tree=True, queue="q", parallelism=7)
    options = replace(options, queue_priority="urgent")
    spec = spec_of(document, options)
    del spec["vast"], spec["source"]
    assert spec == {
        "document": "drive.vast",
        "select": ["sweep-*"],
        "runs": 3,
        "image": "img:1",
        "options": "-t",
        "queueName": "q",
        "queuePriorityClassName": "urgent",
        "parallelism": 7,
    }


@pytest.mark.parametrize(
    "given",
    [
        "resources: {cpu: [{gcp-c4: 4}, {local: 8}]}",
        "resources: {shm_size: [{gcp-c4: 1Gi}, {local: 2Gi}]}",
        "kubernetes: {gpu_resource: [{gcp-c4: nvidia.com/mig-1g.5gb}]}\n  resources: {gpu: 1}",
        "kubernetes: {ephemeral_storage: [{gcp-c4: 8Gi}]}",
    ],
)
def test_the_context_counts_when_values_are_given_per_cluster(folder: Path, given: str) -> None:
    path = folder / "drive.vast"
    options = SubmitOptions(context="gcp-c4")
    assert "cluster" not in spec_of(load_document(path), options)
    path.write_text(f"{DOCUMENT}  {given}\n")
    document = load_document(path)
    assert needs_context(document)
    assert spec_of(document, options)["cluster"] == "gcp-c4"


@pytest.mark.parametrize(
    ("context", "message"),
    [
        (None, "resources have a value for each cluster.* Select one with `--context`"),
        (
            "lab",
            r"resources\.cpu of nav has no value for `lab`; it has values for gcp-c4, local",
        ),
    ],
)
def test_amounts_for_other_clusters_alone_are_refused(
    folder: Path, context: str | None, message: str
) -> None:
    path = folder / "drive.vast"
    amounts = "resources: {cpu: [{gcp-c4: 4}, {local: 8}]}"
    path.write_text(f"{DOCUMENT}  secondary_containers: [{{nav: {{{amounts}}}}}]\n")
    document = load_document(path)
    with pytest.raises(InputError, match=message):
        spec_of(document, SubmitOptions(context=context))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("resources: {cpu: 4 cores}", r"resources\.cpu of execution: `4 cores` is not a number"),
        (
            "resources: {shm_size: much}",
            r"execution\.resources\.shm_size: `much` is not a valid quantity",
        ),
        ("resources: {shm_size: 2Gi, memory: 1Gi}", "no more than `memory`"),
        (
            "kubernetes: {ephemeral_storage: 1GB}",
            r"storage: `1GB` is not a valid quantity of disk",
        ),
        ("kubernetes: {ephemeral_storage: 20}", r"\.ephemeral_storage: `20` is .* `20Gi`"),
        ("secondary_containers: [{nav: {resources: {memory: 4}}}]", r"of nav: `4` is 4 bytes"),
    ],
)
def test_amounts_that_no_pod_can_have_are_refused_before_anything_is_created(
    folder: Path, given: str, message: str
) -> None:
    path = folder / "drive.vast"
    path.write_text(f"{DOCUMENT}  {given}\n")
    with pytest.raises(InputError, match=rf"drive\.vast: .*{message}"):
        spec_of(load_document(path), SubmitOptions())


def test_what_matches_nothing_is_refused_before_anything_is_created(document: Document) -> None:
    with pytest.raises(InputError, match="no configuration matches `halls`"):
        spec_of(document, SubmitOptions("halls"))


@pytest.mark.parametrize("reason", ["size", "number", "a program that is no script"])
def test_files_that_a_campaign_cannot_hold_go_into_an_archive(
    document: Document, monkeypatch: pytest.MonkeyPatch, reason: str
) -> None:
    if reason == "size":
        monkeypatch.setattr(submission, "INLINE_LIMIT", 100)
    elif reason == "number":
        monkeypatch.setattr(submission, "INLINE_FILES", 2)
    else:
        (document.folder / "files/map.png").chmod(0o755)
    made = prepare_submission(document, SubmitOptions(), "x")
    assert made.archive is not None
    again = prepare_submission(document, SubmitOptions(), "y")
    assert again.archive == made.archive
    assert made.campaign["spec"]["source"] == {
        "bundle": {"key": f"{made.archive.sha256}.tar.gz", "sha256": made.archive.sha256}
    }
    with tarfile.open(fileobj=io.BytesIO(gzip.decompress(made.archive.content))) as archive:
        modes = {member.name: member.mode for member in archive.getmembers()}
    assert set(modes) == {
        *("drive.vast", "drive.osc", "files/map.png", "files/ü.txt"),
        *("tools/double.py", "maps/hall.yaml"),
    }
    assert modes["files/map.png"] == (0o755 if reason.startswith("a program") else 0o644)


def test_small_scripts_stay_in_the_campaign(document: Document) -> None:
    script = document.folder / "files/go.sh"
    script.write_text("#!/bin/sh\n")
    script.chmod(0o755)
    assert prepare_submission(document, SubmitOptions(), "x").archive is None


@pytest.mark.parametrize("name", ["My_Drive", "Übung 1", "x" * 90, "...", "a--b"])
def test_names_of_campaigns_are_names_for_kubernetes(document: Document, name: str) -> None:
    vast = document.vast.model_copy(update={"metadata": {"name": name}})
    document = replace(document, vast=vast)
    stable, first, second = (
        campaign_name(document, unique=False),
        campaign_name(document, unique=True),
        campaign_name(document, unique=True),
    )
    assert first != second
    for made in (stable, first, second):
        assert re.fullmatch(DNS_LABEL, made)
        assert len(made) <= 40
    assert first.startswith(stable[:30])


def test_a_document_with_a_strange_file_name_gets_a_plain_one(folder: Path) -> None:
    path = (folder / "drive.vast").rename(folder / "Übung 1.yaml")
    spec = spec_of(load_document(path))
    assert spec["document"] == "bung-1.vast"
    assert "bung-1.vast" in spec["source"]["inline"]["files"]
    assert "Übung 1.yaml" not in spec["source"]["inline"]["files"]

"""What people type who come from the existing tool; docs/how-to/migrate.md says what differs."""

from __future__ import annotations

import logging
import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
import yaml
from robovast_testbed import debian
from robovast_testbed.pytest_plugin import skipped_when_unavailable
from support.campaigns.described import make_old_campaign
from support.campaigns.finished import NAME, finished_campaign


def test_index_makes_the_campaign_store(vast, folder: Path) -> None:
    for name in (NAME, "old_one-2026-03-10-14253007"):
        finished_campaign(folder / "results", 3, name=name)
    outcome = vast("evaluation", "index")
    assert outcome.out.splitlines() == [
        f"results/{NAME}: campaign.db",
        "results/old_one-2026-03-10-14253007: campaign.db",
    ]
    with closing(sqlite3.connect(folder / "results" / NAME / "campaign.db")) as connection:
        units = connection.execute("SELECT config_name, n_samples, status FROM unit").fetchall()
    assert units == [("c-1", 2, "passed"), ("c-2", 1, "passed")]
    assert vast("eval", "index", "-r", f"results/{NAME}").out == (
        f"results/{NAME}: campaign.db is up to date\n"
    )
    assert vast("eval", "index", "-r", f"results/{NAME}", "-f").out.endswith(": campaign.db\n")


def test_a_campaign_with_a_new_run_is_indexed_again(vast, folder: Path) -> None:
    campaign = finished_campaign(folder / "results", 3)
    vast("evaluation", "index")
    late = (campaign / "campaign.db").stat().st_mtime + 5
    os.utime(campaign / "c-2" / "0", (late, late))
    assert vast("evaluation", "index").out == f"results/{NAME}: campaign.db\n"


def test_the_graph_is_drawn(vast, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    campaign = make_old_campaign(folder / "results")
    monkeypatch.setenv("PATH", "")
    outcome = vast("results", "generate-metadata", "--dot-pdf")
    assert outcome.code == 3
    text = (campaign / "metadata.dot").read_text()
    assert text.startswith("digraph provenance {\n")
    assert '"config_generation" [shape=box];' in text
    assert '"config_generation" -> "_config/hall.vast" [label="used"];' in text
    assert not (campaign / "metadata.pdf").exists()


def test_graphviz_draws_the_graph(vast, folder: Path) -> None:
    with skipped_when_unavailable():
        debian.require("dot")
    campaign = make_old_campaign(folder / "results")
    assert vast("results", "generate-metadata", "--dot-pdf").code == 0
    assert (campaign / "metadata.pdf").read_bytes().startswith(b"%PDF")


def test_the_image_of_the_environment_counts_on_the_cluster(
    vast, sweep: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def image(*options: str) -> str | None:
        text = vast("exec", "cluster", "run", "--dry-run", *options).out
        found: str | None = yaml.safe_load(text)["spec"].get("image")
        return found

    assert image() is None
    monkeypatch.setenv("ROBOVAST_IMAGE", "registry/robot:2")
    assert image() == "registry/robot:2"
    assert image("--image", "registry/robot:3") == "registry/robot:3"
    assert vast("exec", "cluster", "prepare-run", "run").code == 0
    assert "image: registry/robot:2" in Path("run/campaign.yaml").read_text()


def test_without_an_image_nothing_is_sent_to_a_cluster(vast, sweep: Path) -> None:
    outcome = vast("exec", "cluster", "run")
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err == (
        "error: runs on a cluster need a container image\n"
        f"hint: set `--image`, ROBOVAST_IMAGE or `execution.image` in {sweep.name}\n"
    )


def test_several_configurations_can_be_named(vast, sweep: Path) -> None:
    outcome = vast("exec", "cluster", "run", "--dry-run", "-c", "fixed", "-c", "sweep-*-2")
    assert yaml.safe_load(outcome.out)["spec"]["select"] == ["fixed", "sweep-*-2"]
    outcome = vast("exec", "local", "run", "-c", "fixed", "-c", "swoop")
    assert (outcome.code, "no configuration matches `swoop`" in outcome.err) == (2, True)


def test_options_of_cluster_configurations_are_taken_and_explained(
    vast, sweep: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcome = vast("exec", "cluster", "prepare-run", "-k", "rke2", "-o", "storage_size=1Gi", "run")
    assert outcome.code == 0
    assert "have an effect only in `vast exec cluster setup`" in outcome.err
    monkeypatch.setenv("KUBECONFIG", "none")
    for command in (["cleanup", "-c", "gcp"], ["run-cleanup"], ["download-cleanup"]):
        outcome = vast("exec", "cluster", *command, "-o", "a=b")
        assert outcome.code == 3, outcome  # there is no cluster
        assert "have an effect only in `vast exec cluster setup`" in outcome.err


def test_requests_are_shown_on_demand(vast, folder: Path) -> None:
    logger = logging.getLogger("urllib3")
    level = logger.level
    try:
        assert vast("results", "download", "--debug", "--from", "share").code == 2
        assert logger.level == logging.DEBUG
    finally:
        logger.setLevel(level)

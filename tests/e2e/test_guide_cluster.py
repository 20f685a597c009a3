"""The developers' guide, "Execute in Cluster", typed as it stands."""

from __future__ import annotations

import json
import shlex
import subprocess

import yaml
from robovast_testbed import images
from support.campaigns.local import make_campaign
from support.kube.lab import QUICK, VAST, Lab


def test_the_guides_commands_work_line_by_line(lab: Lab) -> None:
    """In a project's folder, on the kubeconfig's own context and namespace."""
    config = yaml.safe_load(lab.cluster.kubeconfig.read_text())
    config["contexts"][0]["context"]["namespace"] = lab.namespace
    kubeconfig = lab.folder / "kubeconfig"
    kubeconfig.write_text(yaml.safe_dump(config))
    lab.env = {**lab.env, "KUBECONFIG": str(kubeconfig)}
    document = QUICK.replace("name: one", "name: config1").replace(
        "values: [1, 2, 3]", "values: [1]"
    )
    extra = f"  image: {images.SLIM}\n  runs: 2\n"
    path = make_campaign(lab.folder / "project", "true\n", extra, document)
    lab.folder = path.parent

    def type_in(line: str) -> subprocess.CompletedProcess[str]:
        program, *arguments = shlex.split(line, comments=True)
        assert program == "vast"
        return lab.vast(*arguments)

    type_in("vast init test.vast --results-dir results")
    type_in("vast exec cluster run --config config1 --runs 1  # run single configuration, once")
    type_in("vast results download")
    (first,) = (lab.folder / "results").glob("quick-*/config1-1/0/test.xml")
    type_in("vast results postprocess")
    type_in("vast results postprocess --force")
    asked = type_in("vast results query 'SELECT config, verdict FROM runs' -o json").stdout
    assert json.loads(asked) == [{"config": "config1-1", "verdict": "passed"}]
    asked = type_in("vast results sparql test-results -o json").stdout
    assert json.loads(asked)
    done = type_in("vast exec cluster run --detach")
    assert "monitor" in done.stdout
    type_in("vast exec cluster monitor")
    seen = type_in("vast exec cluster monitor --once").stdout
    assert seen.count("quick") >= 2
    names = [item["metadata"]["name"] for item in lab.get("campaigns")["items"]]
    type_in(f"vast exec cluster run-cleanup --campaign {names[0]}")
    assert len(lab.get("campaigns")["items"]) == 1
    type_in("vast exec cluster run --cleanup")
    assert len(lab.get("campaigns")["items"]) == 1
    type_in("vast results download")
    assert len(list((lab.folder / "results").glob("quick-*/config1-1/1/test.xml"))) >= 1
    type_in("vast exec cluster run-cleanup")
    assert lab.get("campaigns")["items"] == []
    assert first.exists()
    type_in("vast exec cluster prepare-setup --cluster-config generic ./setup_output")
    made = {item.name for item in (lab.folder / "setup_output").iterdir()}
    assert {"README.md", "values.yaml", "robovast"} <= made
    assert VAST.exists()

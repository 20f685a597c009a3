"""What a cluster's admin does: install, try, upgrade, go back, remove."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from robovast_testbed import gobuild, programs
from robovast_testbed.helm import helm
from robovast_testbed.kubernetes import Cluster
from support.campaigns.local import make_campaign
from support.kube.held_runs import HELD, release_until_finished
from support.kube.lab import (
    EMBEDDED,
    QUICK,
    ROOT,
    SYSTEM,
    VAST,
    Lab,
    install,
    install_chart,
)
from support.patience import PATIENCE, eventually

CHART = ROOT / "helm/robovast"
PROGRAMS = ("kubectl", "vast", "helm")
RELEASE = ("--namespace", SYSTEM, "--wait", "--timeout", "5m")

HARD = {
    "requests.cpu": "2",
    "requests.memory": "4Gi",
    "limits.cpu": "4",
    "limits.memory": "8Gi",
    "pods": "5",
    "count/jobs.batch": "1",
    "configmaps": "4",
    "secrets": "11",
    "services": "2",
    "persistentvolumeclaims": "1",
    "requests.storage": "1Gi",
}
"""Of a ResourceQuota: the numbers in the documentation, for one campaign at a time."""
BOUNDS = {
    "type": "Container",
    "min": {"cpu": "20m", "memory": "32Mi"},
    "max": {"cpu": "1", "memory": "2Gi"},
    "maxLimitRequestRatio": {"cpu": "4", "memory": "4"},
}
"""Of a LimitRange: the one for which the documentation has values."""


def commands(notes: str) -> list[str]:
    """The commands in a text, each with the lines that it reads."""
    found, end = [], ""
    for line in notes.splitlines():
        if end:
            found[-1] += f"{line}\n"
            end = "" if line == end else end
        elif line.partition(" ")[0] in PROGRAMS:
            found.append(f"{line}\n")
            marker = re.search(r"<<'(\w+)'$", line)
            end = marker.group(1) if marker else ""
    return found


@pytest.fixture
def shell(installed: Cluster, tmp_path: Path) -> dict[str, str]:
    """The environment of an admin with kubectl, Helm and vast."""
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "kubectl").symlink_to(programs.kubectl())
    (folder / "helm").symlink_to(gobuild.build(programs.HELM))
    (folder / "vast").symlink_to(VAST)
    return {**os.environ, **installed.env, "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}"}


@pytest.fixture
def limited(installed: Cluster, tmp_path: Path) -> Iterator[Cluster]:
    """RoboVAST where all is limited to the needs that the documentation states, with its values."""
    helm(installed, "uninstall", "robovast", *RELEASE)
    for kind, spec in (("ResourceQuota", {"hard": HARD}), ("LimitRange", {"limits": [BOUNDS]})):
        metadata = {"name": "limits", "namespace": SYSTEM}
        installed.apply({"apiVersion": "v1", "kind": kind, "metadata": metadata, "spec": spec})
    page = (ROOT / "docs/reference/cluster-requirements.md").read_text()
    (text,) = re.findall(r"```yaml\n(operator:\n.*?)```", page, re.DOTALL)
    values = tmp_path / "values.yaml"
    values.write_text(text)
    install_chart(installed, CHART, EMBEDDED, values)
    yield installed
    for kind in ("resourcequota", "limitrange"):
        installed.kubectl("delete", kind, "limits", "--namespace", SYSTEM)
    install(installed)


def test_an_admin_who_types_what_the_notes_say_sees_a_first_campaign_to_its_end(
    limited: Cluster, shell: dict[str, str], tmp_path: Path
) -> None:
    """In a namespace with restricted Pod Security, a quota of everything and a LimitRange."""
    notes = helm(limited, "get", "notes", "robovast", "--namespace", SYSTEM)
    typed = commands(notes)
    assert [line.split()[1] for line in typed] == [
        "test", "apply", "wait", "get", "results", "logs", "port-forward", "delete",
    ]  # fmt: skip
    told = ""
    for command in typed:
        if "port-forward" in command:
            assert answers(command, told, shell)
            continue
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=tmp_path, env=shell, capture_output=True, text=True, timeout=300, check=False,
        )  # fmt: skip
        assert done.returncode == 0, command + done.stdout + done.stderr
        told = done.stdout
        if " get campaigns" in command:
            assert re.search(r"^hello\s.*2/2", told, re.MULTILINE), told
    assert len(list(tmp_path.glob("results/hello-*/greeting-*/0/test.xml"))) == 2


def test_helm_test_runs_a_campaign_and_leaves_nothing(installed: Cluster) -> None:
    out = helm(installed, "test", "robovast", "--namespace", SYSTEM, "--timeout=5m")
    assert re.search(r"^TEST SUITE: +robovast-test$", out, re.MULTILINE), out
    assert "Succeeded" in out
    for kind in ("campaigns", "pods", "roles", "serviceaccounts"):
        names = installed.kubectl("get", kind, "--namespace", SYSTEM, "--output=name").split()
        assert not [name for name in names if name.endswith("/robovast-test")]


def answers(forward: str, log: str, shell: dict[str, str]) -> bool:
    """Whether the page is at the address that its log says, while its port is forwarded."""
    address = re.search(r"http://\S+", log)
    assert address, log
    process = subprocess.Popen(["bash", "-c", f"exec {forward}"], env=shell)

    def page() -> bool:
        try:
            with urllib.request.urlopen(address.group(), timeout=30) as answer:  # noqa: S310
                return bool(answer.status == 200)
        except OSError:
            return False

    try:
        return bool(eventually(page, told=f"a page at {address.group()}"))
    finally:
        process.terminate()
        process.wait(PATIENCE)


def older_chart(folder: Path) -> Path:
    """A chart as an earlier version might have been: fewer objects, values and fields."""
    chart = folder / "older"
    shutil.copytree(CHART, chart)
    text = (chart / "Chart.yaml").read_text()
    (chart / "Chart.yaml").write_text(text.replace("\nversion: ", "\nversion: 0.0.1-"))
    for name in ("values.schema.json", *(f"templates/{n}.yaml" for n in ("metrics", "policies"))):
        (chart / name).unlink()
    path = chart / "files/crds/campaign.yaml"
    crd = yaml.safe_load(path.read_text())
    for version in crd["spec"]["versions"]:
        version["additionalPrinterColumns"].pop()
        del version["schema"]["openAPIV3Schema"]["properties"]["spec"]["properties"]["acceptance"]
    path.write_text(yaml.safe_dump(crd))
    path = chart / "templates/operator.yaml"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(line for line in lines if "ROBOVAST_RESTRICTED_RUNS" not in line))
    return chart


def identity(cluster: Cluster, kind: str, name: str) -> str:
    """Which object it is, and what it holds if it is a Secret."""
    found: Any = cluster.get(kind, name, f"--namespace={SYSTEM}")
    return f"{found['metadata']['uid']} {found.get('data')}"


def columns(cluster: Cluster) -> int:
    crd: Any = cluster.get("crd", "campaigns.robovast.io")
    return len(crd["spec"]["versions"][0]["additionalPrinterColumns"])


def wait_until_working(cluster: Cluster) -> None:
    cluster.kubectl(
        *("--namespace", SYSTEM, "rollout", "status", "deployment/robovast-operator"),
        "--timeout=180s",
    )


@pytest.fixture
def older(installed: Cluster, tmp_path: Path) -> Iterator[Cluster]:
    """A cluster on which nothing is left of the installation but its volume, then an older one."""
    helm(installed, "uninstall", "robovast", *RELEASE)
    crds = ("crd/campaigns.robovast.io", "crd/configurations.robovast.io")
    installed.kubectl("delete", *crds, "--timeout=180s")
    install_chart(installed, older_chart(tmp_path))
    yield installed
    install(installed)


def test_campaigns_outlive_upgrade_rollback_and_removal(older: Cluster, lab: Lab) -> None:
    cluster = older
    lab.quick("done", "true\n", "  runs_per_job: 3\n")
    lab.wait("done")
    script = f'[ "$1" != 3 ] || {HELD}'
    lab.quick("underway", script, "  runs: 2\n  runs_per_job: 2\n", parallelism=1)
    eventually(lambda: lab.campaign("underway").get("status", {}).get("runs", {}).get("stored"))
    kept = (
        ("secret", "robovast-storage"),
        ("persistentvolumeclaim", "robovast-s3"),
        ("pod", "robovast-s3-0"),
    )
    before = [identity(cluster, *which) for which in kept]
    done = lab.campaign("done")
    few = columns(cluster)

    install_chart(cluster, CHART)
    wait_until_working(cluster)
    assert lab.campaign("underway")["status"]["state"] == "Running"
    assert [identity(cluster, *which) for which in kept] == before
    assert lab.campaign("done")["metadata"]["uid"] == done["metadata"]["uid"]
    assert columns(cluster) == few + 1
    assert "minPassRatio" in cluster.kubectl("explain", "campaign.spec.acceptance")
    release_until_finished(lab, "underway")
    home = lab.download("underway")
    assert set(lab.verdicts(home).values()) == {"passed"}
    assert len(lab.verdicts(home)) == 6
    logs = [path.read_text() for path in home.glob("_jobs/*/logs/system.log")]
    assert "".join(logs).count("Executing scenario") == 6, "no run is repeated"
    assert lab.campaign("done")["status"]["runs"] == done["status"]["runs"]
    script = make_campaign(lab.folder / "newer", "true\n", document=QUICK)
    newer = lab.prepared(script, "newer")
    newer["spec"]["suspend"] = True
    lab.kubectl("apply", "--server-side", "--filename=-", stdin=json.dumps(newer))

    helm(cluster, "rollback", "robovast", "1", *RELEASE)
    wait_until_working(cluster)
    assert columns(cluster) == few
    assert identity(cluster, *kept[0]) == before[0]
    lab.vast("exec", "cluster", "resume", "-n", lab.namespace, "-i", "newer")
    lab.wait("newer")
    lab.quick("again", "true\n", "  runs_per_job: 3\n")
    lab.wait("again")

    helm(cluster, "uninstall", "robovast", *RELEASE)
    assert [identity(cluster, *which) for which in kept[:2]] == before[:2]
    names = {item["metadata"]["name"] for item in lab.get("campaigns")["items"]}
    assert names == {"done", "underway", "newer", "again"}
    install(cluster)
    assert lab.campaign("done")["status"] == done["status"]
    assert len(lab.verdicts(lab.download("done"))) == 3, "they are on the volume that was kept"

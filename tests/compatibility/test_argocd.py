"""Campaigns that Argo CD syncs from Git, by the page docs/how-to/argocd.md; the nodes are fake."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import textwrap
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest
import yaml
from robovast_testbed import argocd, bed, controlplane
from robovast_testbed.argocd import ArgoCd
from robovast_testbed.pytest_plugin import skipped_when_unavailable
from support.kube.operator_process import (
    FINISH_STAGE,
    OperatorProcess,
    campaign,
    prepare,
    status,
)
from support.patience import PATIENCE, eventually

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/how-to/argocd.md"
CUSTOMIZATIONS = ROOT / "helm/robovast/files/argocd/argocd-cm.yaml"


def finds(campaign: str, shards: int, total: int, failed: str = "") -> str:
    """A Stage of fake nodes: what the finish Job after so many shards of a campaign finds."""
    bad = failed.split(",") if failed else []
    found = {
        "total": total,
        "passed": total - len(bad),
        "failed": len(bad),
        "errored": 0,
        "failedRuns": failed,
        "failing": [f"one-1/{run}" for run in bad],
    }
    if bad:
        found["repeat"] = {"list": "0123456789abcdef", "sizes": f"1x{len(bad)}"}
    stage = yaml.safe_load(FINISH_STAGE.format(campaign=campaign, message=json.dumps(found)))
    stage["metadata"]["name"] += f"-{shards}"
    number = '.metadata.labels["batch.kubernetes.io/job-name"] | split("-") | last'
    chosen = {"key": number, "operator": "In", "values": [str(shards)]}
    stage["spec"]["selector"]["matchExpressions"].append(chosen)
    return yaml.safe_dump(stage)


STAGES = [
    finds("hello", 1, 4),
    finds("hello", 2, 6),
    finds("broken", 1, 4, failed="1,3"),
    finds("broken", 2, 4),
    finds("many", 1, 100),
]


def documented(name: str = "") -> dict[str, Any]:
    """An object of the page by its name; without one, what the page adds to an Application."""
    blocks = PAGE.read_text(encoding="utf-8").split("```yaml\n")[1:]
    objects = [yaml.safe_load(textwrap.dedent(b.partition("```")[0])) for b in blocks]
    names = [obj.get("metadata", {}).get("name", "") for obj in objects]
    return dict(objects[names.index(name)])


@dataclass(frozen=True)
class Team:
    """A Git repository of campaigns, and the page's Application that syncs it."""

    argo: ArgoCd
    folder: Path
    name: str
    """Of the Application and of its namespace."""

    def start(self, application: str = "campaigns") -> None:
        """Make the namespace and the repository, and apply an Application of the page."""
        self.argo.cluster.kubectl("create", "namespace", self.name)
        self._git("init", "--quiet", "--initial-branch=main")
        self._commit({})
        obj = documented(application)
        obj["metadata"]["name"] = self.name
        obj["spec"]["source"]["repoURL"] = f"file://{self.folder}"
        obj["spec"]["destination"]["namespace"] = self.name
        self.argo.cluster.apply(obj)

    def commit(self, **campaigns: dict[str, Any] | None) -> None:
        """Write files of campaigns, or remove them, and make Argo CD look now."""
        self._commit(campaigns)
        self.argo.application(self.name, refresh=True)

    def _commit(self, campaigns: dict[str, dict[str, Any] | None]) -> None:
        folder = self.folder / "campaigns"
        folder.mkdir(exist_ok=True)
        (folder / "README.md").write_text("What our robots have to show.\n")
        for name, obj in campaigns.items():
            file = folder / f"{name}.yaml"
            if obj is None:
                file.unlink()
            else:
                file.write_text(yaml.safe_dump(obj))
        self._git("add", "--all")
        self._git("commit", "--quiet", "--message=Campaigns")

    def _git(self, *arguments: str) -> None:
        who = ("-c", "user.name=Team", "-c", "user.email=team@example.org")
        subprocess.run(["git", *who, *arguments], cwd=self.folder, check=True)

    def becomes(self, sync: str, health: str, seconds: float = PATIENCE) -> None:
        """Wait for the Application."""

        def application() -> dict[str, Any]:
            return self.argo.application(self.name)

        def state() -> tuple[str, ...]:
            found = application().get("status") or {}
            parts = (found.get(part) or {} for part in ("sync", "health"))
            return tuple(part.get("status", "") for part in parts)

        eventually(lambda: state() == (sync, health), seconds, application)

    def health(self, campaign: str) -> dict[str, str]:
        """Status and message that Argo CD shows for a campaign."""
        nodes = self.argo.tree(self.name)
        shown = (n for n in nodes if (n["kind"], n["name"]) == ("Campaign", campaign))
        found: dict[str, Any] = next(shown, {})
        return dict(found.get("health") or {})

    def shows(self, campaign: str, wanted: str, seconds: float = PATIENCE) -> str:
        """Wait for a campaign's health; return its message."""
        eventually(
            lambda: self.health(campaign).get("status") == wanted,
            seconds,
            lambda: self.argo.tree(self.name),
        )
        return self.health(campaign).get("message", "")

    def click(self, campaign: str, action: str) -> None:
        """Use an action of a campaign as soon as it is offered."""
        resource = {
            "group": "robovast.io",
            "version": "v1beta1",
            "kind": "Campaign",
            "namespace": self.name,
            "resourceName": campaign,
        }
        eventually(lambda: self.argo.actions(self.name, resource).get(action))
        self.argo.run_action(self.name, resource, action)

    def jobs(self) -> set[str]:
        """Unique ids of the Jobs."""
        query = "--output=jsonpath={.items[*].metadata.uid}"
        return set(
            self.argo.cluster.kubectl("get", "jobs", f"--namespace={self.name}", query).split()
        )


@pytest.fixture(scope="module")
def argo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ArgoCd]:
    """Argo CD and the operator on a control plane of their own."""
    folder = tmp_path_factory.mktemp("argo")
    with skipped_when_unavailable(), bed.session(f"pytest-{os.getpid()}-argocd") as own:
        cluster = controlplane.start(own, manager_requests=200)
        prepare(cluster, 4, STAGES)
        operator = OperatorProcess(cluster, folder, ROBOVAST_LEASE_SECONDS="2")
        operator.start()
        try:
            yield argocd.start(cluster, CUSTOMIZATIONS)
        finally:
            operator.stop()
        assert "a fault of the operator" not in operator.told()


def judged(kind: str, status: dict[str, Any], **spec: Any) -> tuple[str, str]:
    """What Argo CD says of an object with such a status; conditions are "True" or "False"."""
    found = status.pop("conditions", {})
    conditions = [
        {"type": name, "status": truth, "message": f"{name} is {truth}"}
        for name, truth in found.items()
    ]
    obj = {
        "apiVersion": "robovast.io/v1beta1",
        "kind": kind,
        "metadata": {"name": "any", "namespace": "any", "generation": 2},
        "spec": spec,
        "status": {"observedGeneration": 2, **status, "conditions": conditions},
    }
    with skipped_when_unavailable():
        return argocd.health(obj, CUSTOMIZATIONS)


FINISHED = {"Stalled": "False", "Succeeded": "True", "ResultsAvailable": "True"}


@pytest.mark.parametrize(
    ("status", "spec", "wanted"),
    [
        ({"observedGeneration": 1, "conditions": FINISHED}, {}, "Progressing"),
        ({"conditions": {"Stalled": "False"}}, {"suspend": True}, "Suspended"),
        ({"conditions": {**FINISHED, "Passed": "True"}}, {"suspend": True}, "Healthy"),
        ({"conditions": {"Stalled": "True"}}, {}, "Degraded"),
        ({"conditions": {"Stalled": "False", "Succeeded": "False"}}, {}, "Degraded"),
        ({"conditions": {**FINISHED, "Passed": "False"}}, {}, "Degraded"),
        ({"conditions": {"Passed": "Unknown", "QuotaReserved": "True"}}, {}, "Progressing"),
    ],
)
def test_the_conditions_of_a_campaign_make_its_health(
    status: dict[str, Any], spec: dict[str, Any], wanted: str
) -> None:
    assert judged("Campaign", status, **spec)[0] == wanted


def test_a_campaign_that_waits_says_for_what() -> None:
    status = {"state": "Queued", "progress": "0/20", "conditions": {"QuotaReserved": "False"}}
    assert judged("Campaign", status) == (
        "Progressing",
        "Queued, 0/20 runs; QuotaReserved is False",
    )


@pytest.mark.parametrize(
    ("status", "wanted"),
    [
        ({"conditions": {"Accepted": "False"}}, "Degraded"),
        ({"runs": {"total": 4, "passed": 1}}, "Progressing"),
        ({"runs": {"total": 4, "passed": 1, "failed": 3}}, "Healthy"),
    ],
)
def test_a_configuration_is_healthy_when_its_runs_have_ended(
    status: dict[str, Any], wanted: str
) -> None:
    assert judged("Configuration", status)[0] == wanted


@pytest.fixture
def team(argo: ArgoCd, tmp_path: Path) -> Team:
    made = Team(argo, tmp_path, f"team-{uuid4().hex[:6]}")
    made.start()
    return made


def test_health_is_the_verdict_and_a_click_repeats_the_bad_runs(team: Team) -> None:
    team.commit(hello=documented("hello"))
    assert team.shows("hello", "Healthy") == "4 of 4 runs passed; spec.acceptance requires all."
    team.becomes("Synced", "Healthy")
    query = "--output=jsonpath={.items[*].message}"
    events = team.argo.cluster.kubectl("get", "events", f"--namespace={argocd.NAMESPACE}", query)
    assert "Updated health status: Progressing -> Healthy" in events
    jobs = team.jobs()
    changed = documented("hello")
    changed["spec"]["vast"]["configuration"][0]["variations"] = []
    team.commit(hello=changed)
    assert "another Campaign" in team.shows("hello", "Degraded")
    team.commit(hello=documented("hello"))
    team.shows("hello", "Healthy")
    assert team.jobs() == jobs

    team.commit(broken=campaign("broken", team.name, 2, 2))
    message = team.shows("broken", "Degraded")
    assert message.startswith("2 of 4 runs passed")
    assert message.endswith("one-1/1, one-1/3.")
    team.becomes("Synced", "Degraded")
    team.click("broken", "retry")
    team.shows("broken", "Healthy")
    team.becomes("Synced", "Healthy")
    assert status(team.argo.cluster, team.name, "broken")["attempt"] == 2


def test_what_a_click_changes_is_not_healed(team: Team) -> None:
    held = campaign("held", team.name, 2, 2, scheduling={"nodeSelector": {"no": "node"}})
    team.commit(held=held)
    eventually(lambda: team.health("held").get("message", "").endswith("0/4 runs"))
    team.shows("held", "Progressing")
    team.click("held", "suspend")
    team.shows("held", "Suspended")
    team.argo.application(team.name, refresh=True)
    team.becomes("Synced", "Suspended")
    team.click("held", "resume")
    team.shows("held", "Progressing")
    team.becomes("Synced", "Progressing")


def test_git_wins_where_it_states_what_a_click_changes_unless_told_otherwise(team: Team) -> None:
    nowhere = {"nodeSelector": {"no": "node"}}
    held = campaign("held", team.name, 2, 2, scheduling=nowhere, suspend=False)
    team.commit(held=held)
    team.shows("held", "Progressing")
    team.click("held", "suspend")
    clicked_and_healed = "3 false"
    query = "--output=jsonpath={.metadata.generation} {.spec.suspend}"
    get = ("get", "campaign", "held", f"--namespace={team.name}", query)
    eventually(lambda: team.argo.cluster.kubectl(*get) == clicked_and_healed)
    team.argo.cluster.kubectl(
        *("patch", "application", team.name, f"--namespace={argocd.NAMESPACE}", "--type=merge"),
        f"--patch={json.dumps(documented())}",
    )
    team.click("held", "suspend")
    team.shows("held", "Suspended")
    team.argo.application(team.name, refresh=True)
    team.becomes("Synced", "Suspended")


def test_growth_expiry_and_removal(team: Team) -> None:
    hello = documented("hello")
    hello["spec"]["ttlSecondsAfterFinished"] = 1
    team.commit(hello=hello)
    team.shows("hello", "Healthy")
    eventually(lambda: not team.jobs())
    before = status(team.argo.cluster, team.name, "hello")
    team.argo.application(team.name, refresh=True)
    team.becomes("Synced", "Healthy")
    assert not team.jobs()
    assert status(team.argo.cluster, team.name, "hello") == before

    hello["spec"] |= {"runs": 3, "ttlSecondsAfterFinished": None}
    team.commit(hello=hello)
    eventually(lambda: "6 of 6" in team.health("hello").get("message", ""))
    shards = status(team.argo.cluster, team.name, "hello")["shards"]
    assert [shard["packs"] for shard in shards] == ["0-3", "4-5"]
    assert len(team.jobs()) == 2  # of the new runs, and the index

    # Argo CD never prunes the last object of an Application by itself.
    other = campaign("other", team.name, 1, 1, suspend=True)
    team.commit(hello=None, other=other)
    team.shows("other", "Suspended")
    eventually(lambda: not team.health("hello"))
    eventually(lambda: not team.jobs())


def test_comparisons_follow_health_not_runs(team: Team) -> None:
    log = team.argo.controller_log
    begin = log.stat().st_size
    team.commit(many=campaign("many", team.name, 10, 10))
    team.shows("many", "Healthy", 120)
    team.becomes("Synced", "Healthy")
    with log.open("rb") as lines:
        lines.seek(begin)
        entries = [e for e in map(json.loads, lines) if e.get("application") == team.name]
    asked = Counter(
        f"{entry['kind']} {entry['comparison-level']}"
        for entry in entries
        if entry["msg"] == "Requesting app refresh caused by object update"
    )
    done = Counter(
        str(entry["comparison-level"])
        for entry in entries
        if entry["msg"] == "Reconciliation completed"
    )
    trees = done.pop("0")  # what the Application consists of, without a look into Git
    assert done.total() <= 10, done
    assert trees <= asked.total(), asked
    assert asked["Pod 0"] <= 3 * 100, asked
    assert asked["Campaign 1"] <= 4, asked


def test_the_chart_is_an_application_whose_end_leaves_campaigns_alone(
    argo: ArgoCd, tmp_path: Path
) -> None:
    shutil.copytree(ROOT / "helm", tmp_path / "helm")
    platform = Team(argo, tmp_path, "platform")
    platform.start("robovast")
    platform.becomes("Synced", "Healthy", 120)
    argo.application("platform", refresh=True)
    platform.becomes("Synced", "Healthy")
    application = ("application", "platform", f"--namespace={argocd.NAMESPACE}")
    cascade = {"metadata": {"finalizers": ["resources-finalizer.argocd.argoproj.io"]}}
    argo.cluster.kubectl("patch", *application, "--type=merge", f"--patch={json.dumps(cascade)}")
    argo.cluster.kubectl("delete", *application, "--timeout=180s")
    left = argo.cluster.kubectl("get", "crd,deployments", "--namespace=platform", "--output=name")
    assert "/campaigns.robovast.io" in left
    assert "deployment" not in left

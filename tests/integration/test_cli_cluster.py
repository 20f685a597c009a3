"""`vast exec cluster` against a real API server and real object stores.

There is no operator here: the tests write the status that it would.
"""

from __future__ import annotations

import base64
import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest
import yaml
from robovast_testbed.kubernetes import Cluster
from robovast_testbed.s3 import Server
from support.kube.definitions import await_definitions
from support.kube.fake_cluster import SETTINGS
from support.patience import PATIENCE, eventually
from support.servers.shares import PASSWORD, USER, webdav_server

from robovast.base.errors import InputError
from robovast.campaign.imported import is_imported
from robovast.kubeapi.source_files import inline_files
from robovast.model.packs import PlanSpec, first_blocks
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.s3 import ObjectStore
from robovast_cli.commands.exec.cluster import run as cluster_run
from robovast_cli.commands.exec.cluster import upload_jobs
from robovast_cli.kube.api import KubernetesClient, connect
from robovast_cli.kube.api_errors import UnreachableError
from robovast_cli.kube.status import CampaignState
from robovast_cli.main import command
from robovast_operator.planning.accept import accept
from robovast_operator.planning.campaign import Accepted
from robovast_operator.pods.jobs import campaign_plan
from robovast_operator.pods.jobs import plan_config_map as dump_plan

ROOT = Path(__file__).parents[2]
GROWTH = ROOT / "configs/examples/growth_sim/growth_sim.vast"
VAST = Path(sys.executable).with_name("vast")

one_make = pytest.mark.parametrize("s3_server", ["versitygw"], indirect=True)
"""How makes differ is tested with the storage itself."""


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str


Vast = Callable[..., Outcome]


@pytest.fixture(scope="module")
def known_cluster(control_plane: Cluster) -> Cluster:
    """A cluster that knows Campaigns."""
    control_plane.kubectl(
        "apply", "--server-side", "--force-conflicts", f"--filename={ROOT / 'crds'}"
    )
    await_definitions(control_plane)
    return control_plane


@pytest.fixture
def namespace(known_cluster: Cluster) -> str:
    name = f"test-{uuid4().hex[:8]}"
    known_cluster.kubectl("create", "namespace", name)
    return name


@pytest.fixture
def vast(
    known_cluster: Cluster,
    namespace: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> Vast:
    """Call `vast exec cluster` in a namespace of the test's own."""
    monkeypatch.setenv("KUBECONFIG", str(known_cluster.kubeconfig))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cluster_run, "INTERVAL", 0.1)

    def call(*arguments: object, group: tuple[str, ...] = ("exec", "cluster")) -> Outcome:
        words = ["-V", GROWTH, *group, *arguments, "--namespace", namespace]
        with pytest.raises(SystemExit) as caught:
            command().main(args=list(map(str, words)), prog_name="vast")
        captured = capsys.readouterr()
        return Outcome(int(caught.value.code or 0), captured.out, captured.err)

    return call


class Operator:
    """Writes what the operator would."""

    def __init__(self, cluster: Cluster, namespace: str) -> None:
        self._cluster = cluster
        self._in = f"--namespace={namespace}"

    def names(self) -> list[str]:
        items: Any = self._cluster.get("campaigns", self._in)["items"]
        return [item["metadata"]["name"] for item in items]

    def spec(self, name: str) -> dict[str, Any]:
        found: Any = self._cluster.get("campaign", name, self._in)
        return dict(found["spec"])

    def make_search(self, name: str) -> None:
        """Let a Campaign have a search in place of its configurations."""
        search = {
            "strategy": "random",
            "search_space": {"x": {"type": "bool"}},
            "objectives": [{"name": "failure_rate"}],
            "per_batch": 1,
            "budget": [{"batches": 2}],
            "stopping": [{"target_objective": 1.0}],
        }
        patch = {"spec": {"vast": {"configuration": None, "search": search}}}
        self._cluster.kubectl(
            *("patch", "campaign", name, self._in, "--type=merge", f"--patch={json.dumps(patch)}")
        )

    def report(self, name: str, **status: Any) -> None:
        runs = {"total": 26, "active": 0, "passed": 0, "failed": 0, "errored": 0, "stored": 0}
        patch = {"observedGeneration": 99, "state": "Running", **status}
        patch["runs"] = runs | status.get("runs", {})
        self._cluster.kubectl(
            *("patch", "campaign", name, self._in, "--subresource=status", "--type=merge"),
            f"--patch={json.dumps({'status': patch})}",
        )

    def soon(self, *reports: dict[str, Any]) -> threading.Thread:
        """Report on the first campaign that appears, one report after the other."""

        def run() -> None:
            while not (names := self.names()):
                time.sleep(0.1)
            for report in reports:
                self.report(names[0], **report)
                time.sleep(0.4)

        thread = threading.Thread(target=run)
        thread.start()
        return thread


@pytest.fixture
def operator(known_cluster: Cluster, namespace: str) -> Operator:
    return Operator(known_cluster, namespace)


def condition(kind: str, status: str, reason: str, message: str) -> dict[str, Any]:
    return {
        "type": kind,
        "status": status,
        "reason": reason,
        "message": message,
        "observedGeneration": 1,
        "lastTransitionTime": "2026-01-01T00:00:00Z",
    }


def test_what_a_dry_run_prints_is_what_kubectl_applies(
    vast: Vast, known_cluster: Cluster, namespace: str, operator: Operator
) -> None:
    printed = vast("run", "--dry-run", "-c", "sweep-*", "-r", 3, "-t", "-d", "--queue", "q")
    assert (printed.code, printed.err) == (0, "")
    known_cluster.kubectl("apply", "--filename=-", stdin=printed.out)
    spec = operator.spec("growth-sim")
    assert spec["vast"] == yaml.safe_load(GROWTH.read_text())
    assert spec["source"]["inline"]["files"] == {
        name: (GROWTH.parent / name).read_text()
        for name in ("growth_sim.vast", "scenario.osc", "files/growth_sim.py")
    }
    assert {key: spec[key] for key in ("select", "runs", "options", "queueName", "document")} == {
        "select": ["sweep-*"],
        "runs": 3,
        "options": "-t -d",
        "queueName": "q",
        "document": "growth_sim.vast",
    }
    as_json = vast("run", "--dry-run", "-o", "json", "-c", "sweep-*")
    assert json.loads(as_json.out)["spec"]["vast"] == spec["vast"]


def test_a_detached_run_names_the_campaign_and_what_can_be_done_with_it(
    vast: Vast, operator: Operator
) -> None:
    first, second = vast("run", "--detach"), vast("run", "--detach")
    assert first.code == second.code == 0
    names = operator.names()
    assert len(names) == 2
    assert {outcome.out.split()[1] for outcome in (first, second)} == set(names)
    assert "vast results download -i growth-sim-" in first.out


def test_commands_that_are_printed_choose_the_cluster_that_was_chosen(
    vast: Vast, operator: Operator, contexts: list[str], namespace: str
) -> None:
    chosen = ("-x", "b", "-n", namespace)
    said = vast("run", "--detach", *chosen).out.splitlines()
    (name,) = operator.names()
    given = f" --context b --namespace {namespace}"
    assert [line.split("vast ")[-1] for line in said[1:]] == [
        f"exec cluster monitor{given}",
        f"exec cluster stop -i {name}{given}",
        f"results download -i {name}{given}",
    ]
    assert f"resume -i {name}{given}" in vast("stop", *chosen).out
    assert f"-i {name}{given}\n" in vast("run-cleanup", *chosen).out


def test_who_is_to_be_told_of_the_end_stands_in_a_secret_of_the_campaign(
    vast: Vast, operator: Operator, known_cluster: Cluster, namespace: str, tmp_path: Path
) -> None:
    lines = ["ROBOVAST_NTFY_TOPIC=alice-9f4e1c", "ROBOVAST_NTFY_TOKEN=tk_hidden"]
    (tmp_path / ".env").write_text("\n".join([*lines, "ROBOVAST_WEBHOOK_URL=https://a.example/b"]))
    outcome = vast("run", "--detach")
    assert outcome.code == 0
    assert "Notifications by ntfy and webhook" in outcome.out
    (name,) = operator.names()
    spec = json.dumps(operator.spec(name))
    told = operator.spec(name)["notifications"]
    secret: Any = known_cluster.get("secret", f"robovast-{name}-notify", f"--namespace={namespace}")
    values = {key: base64.b64decode(text).decode() for key, text in secret["data"].items()}
    assert values[told[0]["urlFrom"]["key"]] == "https://ntfy.sh/alice-9f4e1c"
    assert values[told[0]["tokenFrom"]["key"]] == "tk_hidden"
    assert values[told[1]["urlFrom"]["key"]] == "https://a.example/b"
    assert {told[0]["urlFrom"]["name"], told[1]["urlFrom"]["name"]} == {f"robovast-{name}-notify"}
    (owner,) = secret["metadata"]["ownerReferences"]
    assert (owner["kind"], owner["name"]) == ("Campaign", name)
    said = outcome.out + outcome.err + spec
    assert "alice-9f4e1c" not in said
    assert "tk_hidden" not in said


def test_a_campaign_runs_although_nobody_may_be_told_of_its_end(
    vast: Vast,
    operator: Operator,
    known_cluster: Cluster,
    namespace: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    inside = f"--namespace={namespace}"
    rights = ("--verb=create,list", "--resource=campaigns.robovast.io")
    known_cluster.kubectl("create", "role", "runner", inside, *rights)
    account = f"--serviceaccount={namespace}:default"
    known_cluster.kubectl("create", "rolebinding", "runner", inside, "--role=runner", account)
    config = json.loads(known_cluster.kubeconfig.read_text())
    token = known_cluster.kubectl("create", "token", "default", inside).strip()
    config["users"][0]["user"] = {"token": token}
    (tmp_path / "poor.kubeconfig").write_text(json.dumps(config))
    monkeypatch.setenv("KUBECONFIG", str(tmp_path / "poor.kubeconfig"))
    monkeypatch.setenv("ROBOVAST_NTFY_TOPIC", "alice-9f4e1c")
    outcome = vast("run", "--detach")
    assert outcome.code == 0
    assert "No notifications will be sent" in outcome.out
    assert 'cannot create resource "secrets"' in outcome.out
    assert len(operator.names()) == 1


OWN_SHARE = """
from robovast.execution.cluster_execution.share_providers.base import BaseShareProvider

class Own(BaseShareProvider):
    SHARE_TYPE = "own"

    def required_env_vars(self):
        return {"OWN_TOKEN": "an account"}

    def build_pod_env(self):
        import os
        return {"OWN_TOKEN": os.environ["OWN_TOKEN"]}

    def upload_archive(self, archive_path, object_name, progress_callback=None): ...
"""


def test_the_share_that_is_configured_gets_the_results_of_a_campaign(
    vast: Vast,
    operator: Operator,
    known_cluster: Cluster,
    namespace: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("ROBOVAST_SHARE_TYPE", "own.py:Own")
    (tmp_path / "own.py").write_text(OWN_SHARE)
    refused = vast("run", "--detach")
    assert refused.code == 2
    assert "OWN_TOKEN" in refused.err
    assert operator.names() == []
    (tmp_path / ".env").write_text("OWN_TOKEN=hidden\n")
    outcome = vast("run", "--detach")
    assert outcome.code == 0, outcome.err
    assert "Its results are uploaded to the file share" in outcome.out
    (name,) = operator.names()
    wanted = f"robovast-{name}-share"
    assert operator.spec(name)["share"] == {"secretName": wanted}
    secret: Any = known_cluster.get("secret", wanted, f"--namespace={namespace}")
    assert base64.b64decode(secret["data"]["OWN_TOKEN"]) == b"hidden"
    assert "hidden" not in outcome.out + outcome.err + json.dumps(operator.spec(name))


@pytest.mark.parametrize(
    "line", ["ROBOVAST_NTFY_TOPIC=a/b", "ROBOVAST_WEBHOOK_URL=//nowhere.example/secret"]
)
def test_a_receiver_that_cannot_be_told_is_refused_before_anything_is_created(
    vast: Vast, operator: Operator, tmp_path: Path, line: str
) -> None:
    (tmp_path / ".env").write_text(line)
    outcome = vast("run", "--detach")
    assert outcome.code == 2
    variable, _, value = line.partition("=")
    assert variable in outcome.err
    assert value not in outcome.err
    assert operator.names() == []


@pytest.mark.parametrize(
    ("runs", "state", "conditions", "code", "said"),
    [
        ({"passed": 26}, "Finished", [], 0, "26 of 26 done: 26 passed."),
        ({"passed": 24, "failed": 1, "errored": 1}, "Finished", [], 1, "unsuccessful: sweep-1-1/0"),
        ({"passed": 25, "errored": 1}, "Finished", [], 4, "1 errored"),
        (
            {"total": 0},
            "Failed",
            [condition("Succeeded", "False", "IncompatibleImage", "image has version 1, not 2")],
            3,
            "image has version 1, not 2",
        ),
        (
            {"total": 0},
            "Failed",
            [condition("Accepted", "False", "Invalid", "no configuration matches `x`")],
            2,
            "no configuration matches `x`",
        ),
    ],
)
def test_a_followed_run_ends_with_the_exit_code_of_a_local_one(
    vast: Vast,
    operator: Operator,
    runs: dict[str, int],
    state: str,
    conditions: list[dict[str, Any]],
    code: int,
    said: str,
) -> None:
    bad = runs.get("failed", 0) + runs.get("errored", 0)
    failing = ["sweep-1-1/0"] if bad else []
    thread = operator.soon(
        {"runs": {"passed": 3, "active": 4}},
        {"runs": runs, "state": state, "conditions": conditions, "failing": failing},
    )
    outcome = vast("run")
    thread.join()
    assert (outcome.code, outcome.err) == (code, "")
    assert said in outcome.out


def test_ctrl_c_ends_only_the_following(
    known_cluster: Cluster, namespace: str, operator: Operator, tmp_path: Path
) -> None:
    process = subprocess.Popen(
        [VAST, "-V", GROWTH, "exec", "cluster", "run", "-n", namespace],
        env={"KUBECONFIG": str(known_cluster.kubeconfig), "PATH": "/usr/bin:/bin"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert "was created in the namespace" in process.stdout.readline()
    process.stdout.readline()  # it follows
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, err) == (130, "")
    (name,) = operator.names()
    assert f"The campaign {name} continues" in out
    assert f"vast exec cluster stop -i {name}" in out


def test_an_estimate_tells_of_earlier_campaigns_and_creates_nothing(
    vast: Vast, operator: Operator
) -> None:
    outcome = vast("run", "--estimate")
    assert outcome.code == 0
    assert "No estimate: no campaign of" in outcome.out + outcome.err
    assert operator.names() == []
    for _ in range(3):
        assert vast("run", "--detach", "--parallelism", 13).code == 0
    for number, name in enumerate(operator.names()):
        times = {"startTime": "2026-01-01T00:00:00Z"}
        times["completionTime"] = f"2026-01-01T00:{10 + number}:00Z"
        operator.report(name, state="Finished", runs={"total": 26, "passed": 26}, **times)
    outcome = vast("run", "--estimate", "--parallelism", 13)
    said = outcome.out + outcome.err
    assert outcome.code == 0
    assert "26 runs, at most 13 in parallel" in said
    assert "Estimated duration: 10:58 (90 % interval" in said
    assert "based on 3 earlier campaigns" in said
    assert len(operator.names()) == 3


def test_an_option_that_no_campaign_can_hold_creates_nothing(
    vast: Vast, operator: Operator
) -> None:
    outcome = vast("run", "--detach", "--parallelism", 100_000)
    assert (outcome.code, outcome.out) == (2, "")
    assert "parallelism: " in outcome.err
    assert operator.names() == []


def test_what_the_api_server_refuses_has_a_line_for_each_field(
    known_cluster: Cluster, namespace: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("KUBECONFIG", str(known_cluster.kubeconfig))
    document = yaml.safe_load(GROWTH.read_text())
    document["execution"]["timeout"] = "many"
    campaign = {
        "apiVersion": "robovast.io/v1beta1",
        "kind": "Campaign",
        "metadata": {"name": "bad"},
        "spec": {"vast": document, "parallelism": 0},
    }
    with connect(namespace=namespace) as kube, pytest.raises(InputError) as caught:
        kube.create_campaign(campaign)
    lines = str(caught.value).splitlines()
    assert lines[0].endswith("rejected the Campaign `bad`:")
    assert {line.strip().partition(":")[0] for line in lines[1:]} >= {
        "execution.timeout",
        "spec.parallelism",
    }


def test_who_may_not_is_told_what_is_missing(
    vast: Vast, known_cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    token = known_cluster.kubectl("create", "token", "default", "--namespace=default").strip()
    config = json.loads(known_cluster.kubeconfig.read_text())
    config["users"][0]["user"] = {"token": token}
    (tmp_path / "poor.kubeconfig").write_text(json.dumps(config))
    monkeypatch.setenv("KUBECONFIG", str(tmp_path / "poor.kubeconfig"))
    outcome = vast("run", "--detach")
    assert outcome.code == 3
    assert "denied the request" in outcome.err
    assert 'cannot create resource "campaigns"' in outcome.err
    assert token not in outcome.err


@pytest.mark.parametrize(
    ("before", "said"),
    [
        ("", "system:serviceaccount:default:default"),
        ("test -e asked || token=ended; touch asked;", "system:serviceaccount:default:default"),
        ("echo your session has ended >&2; exit 1;", "the login program `sh` of the kubeconfig"),
    ],
    ids=["gives it", "gives another one once the first has ended", "fails"],
)
def test_a_program_that_the_kubeconfig_names_gives_the_token(
    vast: Vast,
    known_cluster: Cluster,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    before: str,
    said: str,
) -> None:
    token = known_cluster.kubectl("create", "token", "default", "--namespace=default").strip()
    version = "client.authentication.k8s.io/v1"
    answer = {"apiVersion": version, "kind": "ExecCredential", "status": {"token": "TOKEN"}}
    script = f"token={token}; {before} echo '{json.dumps(answer)}' | sed s/TOKEN/$token/"
    program = {"apiVersion": version, "command": "sh", "args": ["-c", script]}
    config = json.loads(known_cluster.kubeconfig.read_text())
    config["users"][0]["user"] = {"exec": program | {"interactiveMode": "Never"}}
    (tmp_path / "program.kubeconfig").write_text(json.dumps(config))
    monkeypatch.setenv("KUBECONFIG", str(tmp_path / "program.kubeconfig"))
    outcome = vast("monitor", "--once")
    assert outcome.code == 3
    assert said in outcome.err
    assert token not in outcome.err


def test_an_api_server_that_is_not_there_is_named(
    vast: Vast, known_cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = json.loads(known_cluster.kubeconfig.read_text())
    config["clusters"][0]["cluster"]["server"] = "https://127.0.0.1:1"
    (tmp_path / "gone.kubeconfig").write_text(json.dumps(config))
    monkeypatch.setenv("KUBECONFIG", str(tmp_path / "gone.kubeconfig"))
    outcome = vast("monitor", "--once")
    assert outcome.code == 3
    assert "`robovast-testbed` (https://127.0.0.1:1)" in outcome.err
    assert ": Connection refused\nhint: check that the cluster is running" in outcome.err


def test_a_cluster_without_robovast_says_how_to_install_it(
    vast: Vast, known_cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    from robovast_cli.kube import api as kubernetes

    monkeypatch.setattr(kubernetes, "API_VERSION", "elsewhere.robovast.io/v1beta1")
    outcome = vast("monitor", "--once")
    assert outcome.code == 3
    assert "vast exec cluster setup" in outcome.err


def test_monitor_shows_all_campaigns_and_what_hinders_them(vast: Vast, operator: Operator) -> None:
    vast("run", "--detach"), vast("run", "--detach")
    first, second = operator.names()
    waits = condition("QuotaReserved", "False", "Pending", "the queue `q` is full")
    operator.report(first, runs={"passed": 5, "failed": 1, "active": 2})
    operator.report(second, state="Queued", conditions=[waits])
    table = vast("monitor", "--once").out
    assert sorted(line.split()[:3] for line in table.splitlines()[1:3]) == [
        [first, "Running", "6/26"],
        [second, "Queued", "0/26"],
    ]
    assert f"{second}: the queue `q` is full" in table
    finish = threading.Timer(1, lambda: [end(operator, name) for name in (first, second)])
    finish.start()
    lines = vast("monitor", "-i", 0.2).out.splitlines()
    finish.join()
    assert f"{first}  Running  6 of 26 done: 5 passed, 1 failed; 2 running" in lines
    assert {f"{name}  Finished  26 of 26 done: 26 passed" for name in (first, second)} <= set(lines)
    assert "No campaign is running" in vast("monitor").out


def end(operator: Operator, name: str) -> None:
    operator.report(name, state="Finished", runs={"passed": 26}, conditions=[])


def test_stop_resume_and_retry_change_what_the_operator_reads(
    vast: Vast, operator: Operator
) -> None:
    vast("run", "--detach")
    (name,) = operator.names()
    assert vast("stop").code == 0
    assert operator.spec(name)["suspend"] is True
    assert vast("stop").code == 2
    assert vast("resume", "-i", name).code == 0
    assert operator.spec(name)["suspend"] is False
    assert vast("retry", "-i", name).code == 2
    operator.report(name, state="Finished", runs={"passed": 25, "failed": 1})
    outcome = vast("retry", "-i", name)
    assert outcome.out == f"{name}: retrying 1 run.\n"
    assert operator.spec(name)["attempt"] == 2


def test_a_search_is_given_more_batches(vast: Vast, operator: Operator) -> None:
    vast("run", "--detach")
    (name,) = operator.names()
    refused = vast("resume", "-i", name, "--batches", 3)
    assert refused.code == 2
    assert "is not a campaign that is a search" in refused.err
    operator.make_search(name)
    operator.report(name, state="Finished", search={"batch": 2})
    refused = vast("resume", "-i", name, "--batches", 2)
    assert refused.code == 2
    assert "has 2 batches already" in refused.err
    assert vast("resume", "--batches", 3).out == f"{name}: resumed.\n"
    search = operator.spec(name)["vast"]["search"]
    assert (search["budget"], search["stopping"]) == ([{"batches": 3}], [])
    assert search["strategy"] == "random"


def test_run_cleanup_removes_what_is_finished_or_named(vast: Vast, operator: Operator) -> None:
    vast("run", "--detach"), vast("run", "--detach")
    first, second = operator.names()
    operator.report(first, state="Finished", runs={"passed": 26}, bucket="b")
    outcome = vast("run-cleanup")
    assert f"{first}: deleted; its results remain in the bucket b." in outcome.out
    assert f"run-cleanup -i {second}" in outcome.out
    assert vast("run-cleanup", "-i", second).code == 0
    eventually(lambda: not operator.names())


def test_a_run_with_cleanup_removes_finished_campaigns_before(
    vast: Vast, operator: Operator
) -> None:
    vast("run", "--detach")
    (old,) = operator.names()
    operator.report(old, state="Finished", runs={"passed": 26})
    assert vast("run", "--detach", "--cleanup", "-c", "nothing").code == 2
    assert operator.names() == [old], "nothing is removed for a run that does not begin"
    assert vast("run", "--detach", "--cleanup").code == 0
    eventually(lambda: old not in operator.names() and len(operator.names()) == 1)


@dataclass(frozen=True)
class Stored:
    """A finished campaign with results in a real store."""

    name: str
    bucket: str
    store: ObjectStore


@pytest.fixture
def stored(
    vast: Vast,
    operator: Operator,
    s3_server: Server,
    known_cluster: Cluster,
    namespace: str,
) -> Iterator[Stored]:
    credentials = Credentials(s3_server.access_key, s3_server.secret_key)
    store = ObjectStore(Endpoint.parse(f"http://{s3_server.endpoint}"), credentials, patience=20)
    known_cluster.apply(secret("robovast-storage", namespace, s3_server))
    vast("run", "--detach")
    (name,) = operator.names()
    bucket = f"{name}-2026"
    store.make_bucket(bucket)
    store.put_bytes(bucket, "sweep-1-1/0/test.xml", b"<testsuite/>")
    store.put_bytes(bucket, "sweep-1-1/0/run.json", b'{"job": "job-0"}')
    operator.report(
        name,
        state="Finished",
        bucket=bucket,
        campaign=f"{name}-2026",
        endpoint=f"http://{s3_server.endpoint}",
        runs={"passed": 26},
    )
    yield Stored(name, bucket, store)
    store.delete_bucket(bucket)


def secret(name: str, namespace: str, server: Server, **more: str) -> dict[str, object]:
    keys = {"accessKey": server.access_key, "secretKey": server.secret_key, **more}
    return {
        "apiVersion": "v1",
        "kind": "Secret",
        "metadata": {"name": name, "namespace": namespace},
        "data": {key: base64.b64encode(value.encode()).decode() for key, value in keys.items()},
    }


@pytest.fixture
def contexts(vast: Vast, known_cluster: Cluster, tmp_path: Path, monkeypatch: Any) -> list[str]:
    """Two contexts, `a` and `b`, of one cluster."""
    config = json.loads(known_cluster.kubeconfig.read_text())
    (known,) = config["contexts"]
    config["contexts"] = [{**known, "name": name} for name in "ab"]
    path = tmp_path / "two.kubeconfig"
    path.write_text(json.dumps(config))
    monkeypatch.setenv("KUBECONFIG", str(path))
    return ["a", "b"]


@pytest.mark.parametrize("error", [KeyboardInterrupt(), UnreachableError("no answer")])
def test_no_campaign_is_left_behind_when_nobody_says_whether_it_was_created(
    vast: Vast, operator: Operator, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    create, made = KubernetesClient.create_campaign, []

    def create_silently(kube: KubernetesClient, campaign: dict[str, Any]) -> dict[str, Any]:
        made.append(create(kube, campaign))
        raise error

    monkeypatch.setattr(KubernetesClient, "create_campaign", create_silently)
    assert vast("run", "--detach").code != 0
    assert len(made) == 1
    assert operator.names() == []


def test_a_campaign_that_is_deleted_ends_the_following(
    vast: Vast, operator: Operator, known_cluster: Cluster, namespace: str
) -> None:
    def happen() -> None:
        (name,) = eventually(operator.names)
        known_cluster.kubectl("delete", "campaign", name, f"--namespace={namespace}")

    happening = threading.Thread(target=happen)
    happening.start()
    outcome = vast("run")
    happening.join()
    name = outcome.out.split()[1]
    last = f"error: {name} was deleted from the cluster (namespace {namespace})"
    assert outcome.err.splitlines()[-1] == last
    assert outcome.code == 3


@pytest.mark.parametrize("command", ["run", "monitor", "stop"])
def test_a_second_context_is_refused(vast: Vast, command: str, contexts: list[str]) -> None:
    outcome = vast(command, *(word for name in contexts for word in ("-x", name)))
    assert outcome.code == 2
    assert "is given twice, but this command uses one cluster" in outcome.err


PACK_LOG = "[robovast] job x\n[robovast] run {0}\nof the first\n[robovast] run {1}\nof the second\n"


def store_pack(stored: Stored, first: str, second: str) -> None:
    """Two runs of one pack, the second of which has failed; the index names it."""
    index = []
    for run, verdict in ((first, "passed"), (second, "failed")):
        variant, _, number = run.partition("/")
        record = {
            "campaign": stored.name,
            "variant": variant,
            "entry": "sweep",
            "run": int(number),
            "id": 0,
            "verdict": verdict,
            "reason": "" if verdict == "passed" else "too slow",
            "started_at": "2026-01-01T00:00:00Z",
            "finished_at": "2026-01-01T00:00:01Z",
            "duration": 1.0,
            "exit_code": None,
            "attempt": 1,
            "job": "job-7",
            "runtime": "cluster",
            "image": "i",
            "image_digest": "",
            "host": "h",
        }
        index.append(record)
        stored.store.put_bytes(stored.bucket, f"{run}/run.json", json.dumps(record).encode())
    text = json.dumps({"campaign": stored.name, "runs": index}).encode()
    stored.store.put_bytes(stored.bucket, "_execution/index.json", text)
    begun = b"# attempt 1\na: {_output_dir: x}\n---\na: {_output_dir: y}\n"
    stored.store.put_bytes(stored.bucket, "_transient/job-7.params.yaml", begun)
    log = PACK_LOG.format(first, second).encode()
    stored.store.put_bytes(stored.bucket, "_jobs/job-7/logs/system.log", log)
    stored.store.put_bytes(stored.bucket, "_jobs/job-7/logs/system_sim.log", b"1\n2\n3\n")


@one_make
def test_the_log_of_a_stored_run_is_its_part_of_the_packs(vast: Vast, stored: Stored) -> None:
    store_pack(stored, "sweep-1-1/0", "sweep-1-2/0")
    first = vast("logs", "sweep-1-1/0")
    assert (first.code, first.err) == (0, "")
    assert first.out.splitlines() == ["[robovast] run sweep-1-1/0", "of the first"]
    failed = vast("logs", stored.name, "--failed")
    assert (failed.code, failed.err) == (0, "")
    assert failed.out.splitlines() == [
        "==> sweep-1-2/0: failed: too slow <==",
        "[robovast] run sweep-1-2/0",
        "of the second",
        "",
    ]
    other = vast("logs", f"{stored.name}-2026", "sweep-1-2/0", "--secondary", "sim", "--tail", 2)
    assert (other.code, other.out.splitlines()) == (0, ["2", "3"])
    assert "the log is from a job with 2 runs and cannot be divided" in other.err
    none = vast("logs", "sweep-1-2/0", "--secondary", "radio")
    assert (none.code, none.out) == (2, "")
    assert "logs/system.log, logs/system_sim.log" in none.err
    for arguments in (("runs",), ("runs", stored.name, "--failed")):
        head, row, counts = vast(*arguments).out.splitlines()
        assert head.split() == ["RUN", "STATE", "TIME", "POD", "NODE", "WHY"]
        assert row.split() == ["sweep-1-2/0", "failed", "0:01", "h", "too", "slow"]
        assert counts == f"{stored.name}: 26 of 26 done: 26 passed."


def test_a_run_without_a_log_says_why_and_one_that_is_none_which_there_are(
    vast: Vast, operator: Operator, known_cluster: Cluster, namespace: str
) -> None:
    vast("run", "--detach")
    (name,) = operator.names()
    waits = condition("QuotaReserved", "False", "Pending", "the queue `q` is full")
    operator.report(name, state="Queued", conditions=[waits])
    assert vast("logs", "sweep-1-1/0").err == "sweep-1-1/0 is pending: the queue `q` is full.\n"
    known_cluster.apply(plan_config_map(known_cluster, name, namespace))
    operator.report(name, conditions=[])
    outcome = vast("logs", name, "sweep-1-1/0")
    assert (outcome.code, outcome.out) == (0, "")
    assert "sweep-1-1/0 is pending: the run has no pod yet (0 of 26 done)." in outcome.err
    none = vast("runs", name)
    assert (none.code, none.out.splitlines()) == (
        0,
        ["No running and no unsuccessful runs.", f"{name}: 0 of 26 done."],
    )
    assert vast("runs", "--failed").out.splitlines()[0] == "No unsuccessful runs."
    assert vast("runs", "other").code == 2
    unknown = vast("logs", "sweep-9-9/0")
    assert unknown.code == 2
    assert "the campaign has no run `sweep-9-9/0`; it has 13" in unknown.err
    assert vast("logs").code == vast("logs", "--failed", "--follow").code == 2


@pytest.mark.parametrize("command", ["logs", "debug"])
def test_of_a_campaign_that_is_not_accepted_the_reason_is_told_in_place_of_a_run(
    vast: Vast, operator: Operator, command: str
) -> None:
    vast("run", "--detach")
    (name,) = operator.names()
    wrong = condition("Accepted", "False", "AssetsNotFound", "no claim `worlds`")
    operator.report(name, state="Rejected", conditions=[wrong])
    outcome = vast(command, name, "sweep-1-1/0")
    assert (outcome.code, outcome.out) == (2, "")
    assert f"{name} was rejected, so it has no runs: no claim `worlds`" in outcome.err
    assert "no claim `worlds`" in vast("runs", name).out


def test_a_shell_of_a_run_that_is_not_executed_names_the_command_that_says_more(
    vast: Vast, operator: Operator, known_cluster: Cluster, namespace: str
) -> None:
    vast("run", "--detach")
    (name,) = operator.names()
    known_cluster.apply(plan_config_map(known_cluster, name, namespace))
    outcome = vast("shell", name, "sweep-1-1/0")
    assert outcome.code == 3
    assert (
        f"`vast exec cluster logs {name} sweep-1-1/0 --namespace {namespace}` to see" in outcome.err
    )


def plan_config_map(cluster: Cluster, name: str, namespace: str) -> dict[str, Any]:
    """The plan that the operator would make of a campaign of growth_sim."""
    obj: Any = cluster.get("campaign", name, f"--namespace={namespace}")
    made = accept(obj, inline_files(obj["spec"]), SETTINGS)
    assert isinstance(made, Accepted), made
    plan = PlanSpec(blocks=first_blocks(made.entries, 1))
    return dict(dump_plan(made, f"{name}-plan-0", campaign_plan(made, plan, made.entries)))


@one_make
def test_results_come_home_with_the_keys_of_the_clusters_secret(
    vast: Vast, stored: Stored, tmp_path: Path
) -> None:
    outcome = vast("download", "-o", "home", group=("results",))
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.startswith(f"home/{stored.name}-2026: 1 run, ")
    assert (tmp_path / f"home/{stored.name}-2026/sweep-1-1/0/test.xml").is_file()
    assert is_imported(tmp_path / f"home/{stored.name}-2026")
    assert "(1 already existed)" in vast("download", "-o", "home", group=("results",)).out


@one_make
def test_a_run_is_replayed_by_its_name_in_the_storage(
    vast: Vast, stored: Stored, tmp_path: Path
) -> None:
    outcome = vast(f"{stored.name}-2026/sweep-1-1/0", group=("replay",))
    folder = tmp_path / f"replays/originals/{stored.name}-2026"
    assert (folder / "sweep-1-1/0/test.xml").is_file()
    assert not (folder / "_jobs").exists()
    assert outcome.code == 2  # of this campaign, only a run was stored
    nothing = vast("nothing/sweep-1-1/0", group=("replay",))
    assert (nothing.code, "there is no campaign `nothing`" in nothing.err) == (2, True)


@one_make
def test_results_whose_campaign_was_removed_are_found_by_name(
    vast: Vast, stored: Stored, s3_server: Server, known_cluster: Cluster, namespace: str
) -> None:
    endpoint = f"http://{s3_server.endpoint}"
    known_cluster.apply(secret("robovast-storage", namespace, s3_server, endpoint=endpoint))
    assert vast("run-cleanup").code == 0
    outcome = vast("download", "-i", stored.bucket, "-o", "home", group=("results",))
    assert outcome.code == 0, outcome.err
    nothing = vast("download", "-i", "nothing", "-o", "home", group=("results",))
    assert nothing.code == 2
    assert "there is no campaign `nothing`" in nothing.err


@one_make
def test_without_keys_it_is_said_which_are_missing(
    vast: Vast, stored: Stored, known_cluster: Cluster, namespace: str
) -> None:
    known_cluster.kubectl("delete", "secret", "robovast-storage", f"--namespace={namespace}")
    outcome = vast("download", group=("results",))
    assert outcome.code == 3
    assert "ROBOVAST_S3_ACCESS_KEY" in outcome.err


@one_make
def test_results_that_were_removed_keep_no_others(
    vast: Vast,
    stored: Stored,
    operator: Operator,
    s3_server: Server,
    known_cluster: Cluster,
    namespace: str,
    tmp_path: Path,
) -> None:
    vast("run", "--detach")
    (name,) = set(operator.names()) - {stored.name}
    endpoint = f"http://{s3_server.endpoint}"
    known_cluster.apply(secret("robovast-storage", namespace, s3_server, endpoint=endpoint))
    known: Any = known_cluster.get("campaign", name, f"--namespace={namespace}")
    made = CampaignState(known)
    stored.store.make_bucket(made.bucket)
    stored.store.put_bytes(made.bucket, "sweep-1-1/0/run.json", b'{"job": "job-0"}')
    outcome = vast("download", "-i", name, "-o", "unreported", group=("results",))
    stored.store.delete_bucket(made.bucket)
    assert (outcome.code, outcome.err) == (0, ""), "the status of the Campaign is missing"
    assert (tmp_path / "unreported" / made.folder / "sweep-1-1/0/run.json").is_file()
    bucket = {"bucket": f"{name}-gone", "campaign": "gone", "endpoint": endpoint}
    operator.report(name, **bucket)
    outcome = vast("download", "-o", "home", group=("results",))
    assert (outcome.code, outcome.err) == (0, "")
    assert f"{name}: nothing is stored yet" in outcome.out
    assert [path.name for path in (tmp_path / "home").iterdir()] == [f"{stored.name}-2026"]
    operator.report(name, **bucket, state="Finished")
    outcome = vast("download", "-o", "home", group=("results",))
    assert outcome.code == 5
    assert "NoSuchBucket" in outcome.err
    assert "incomplete download: gone\n" in outcome.err
    assert (tmp_path / f"home/{stored.name}-2026/sweep-1-1/0/run.json").is_file()


@one_make
def test_download_cleanup_removes_buckets_of_finished_campaigns(vast: Vast, stored: Stored) -> None:
    assert vast("download-cleanup", "--yes").code == 0
    assert stored.bucket not in stored.store.buckets()


@one_make
def test_run_cleanup_with_data_removes_the_bucket_too(
    vast: Vast, stored: Stored, operator: Operator
) -> None:
    outcome = vast("run-cleanup", "-i", stored.name, "--data")
    assert outcome.out == f"{stored.name}: deleted.\n"
    assert stored.bucket not in stored.store.buckets()
    assert operator.names() == []


@one_make
def test_many_files_go_into_an_archive_in_the_store(
    vast: Vast,
    s3_server: Server,
    known_cluster: Cluster,
    namespace: str,
    operator: Operator,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from robovast.kubeapi import submission

    monkeypatch.setattr(submission, "INLINE_LIMIT", 1000)
    endpoint = f"http://{s3_server.endpoint}"
    known_cluster.apply(secret("robovast-storage", namespace, s3_server, endpoint=endpoint))
    outcome = vast("run", "--detach")
    assert (outcome.code, outcome.err) == (0, "")
    (name,) = operator.names()
    bundle = operator.spec(name)["source"]["bundle"]
    credentials = Credentials(s3_server.access_key, s3_server.secret_key)
    store = ObjectStore(Endpoint.parse(endpoint), credentials, patience=20)
    assert store.digest("robovast-bundles", bundle["key"]) == bundle["sha256"]


@pytest.fixture
def shared(
    vast: Vast,
    operator: Operator,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> Iterator[Path]:
    """A finished campaign `hall-2026`, and a share; gives the folder of the share."""
    vast("run", "--detach")
    (name,) = operator.names()
    results = {"bucket": "hall-2026", "campaign": "hall-2026", "endpoint": "http://s3.ns.svc:9000"}
    operator.report(name, state="Finished", runs={"passed": 26}, **results)
    (tmp_path / "share").mkdir()
    with webdav_server(tmp_path / "share") as address:
        monkeypatch.setenv("ROBOVAST_SHARE_TYPE", "webdav")
        monkeypatch.setenv("ROBOVAST_WEBDAV_URL", f"http://{address}")
        monkeypatch.setenv("ROBOVAST_WEBDAV_USER", USER)
        monkeypatch.setenv("ROBOVAST_WEBDAV_PASSWORD", PASSWORD)
        monkeypatch.setattr(upload_jobs, "INTERVAL", 0.2)
        yield tmp_path / "share"


@pytest.fixture
def nodeless(known_cluster: Cluster) -> Iterator[None]:
    """No pod finds a node, whatever other tests have brought up."""
    fake = "--selector=type=kwok"
    known_cluster.kubectl("cordon", fake)
    yield
    known_cluster.kubectl("uncordon", fake)


@pytest.mark.usefixtures("nodeless")
def test_an_upload_is_begun_once_and_leaves_nothing_when_it_cannot_begin(
    vast: Vast,
    shared: Path,
    known_cluster: Cluster,
    namespace: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    inside = f"--namespace={namespace}"

    def uid() -> str:
        (job,) = known_cluster.get("jobs", inside)["items"]
        return str(job["metadata"]["uid"])

    def made() -> list[str]:
        return known_cluster.kubectl("get", "jobs,secrets", inside, "--output=name").split()

    upload = ("upload-to-share", "--image", "agent:1")
    outcome = vast("upload-to-share")
    assert (outcome.code, made()) == (3, [])
    assert "hint: set it with `--image`" in outcome.err

    known_cluster.kubectl("create", "quota", "none", inside, "--hard=count/secrets=0")
    eventually(lambda: "used" in known_cluster.get("quota", "none", inside)["status"])
    outcome = vast(*upload, "--detach")
    assert (outcome.code, made()) == (3, [])
    assert "exceeded quota" in outcome.err
    known_cluster.kubectl("delete", "quota", "none", inside)

    outcome = vast(*upload, "--detach")
    assert (outcome.code, outcome.err) == (0, "")
    assert "logs job/hall-2026-share" in outcome.out
    first = uid()
    assert "another upload is in progress" in vast(*upload, "--detach").out
    assert uid() == first
    # as a client leaves it that ends before the Secret is there
    known_cluster.kubectl(
        "patch", "job/hall-2026-share", inside, '--patch={"spec":{"suspend":true}}'
    )
    assert "in progress" not in vast(*upload, "--detach").out
    assert uid() != first

    (shared / "hall-2026.tar.gz").touch()
    outcome = vast(*upload)
    assert (outcome.code, outcome.out) == (
        0,
        "hall-2026: exists on the file share; `--force` replaces it.\n",
    )
    monkeypatch.setenv("ROBOVAST_WEBDAV_PASSWORD", "wrong-one")
    outcome = vast(*upload, "--force")
    assert outcome.code == 5
    assert "hint: check ROBOVAST_WEBDAV_USER and ROBOVAST_WEBDAV_PASSWORD" in outcome.err
    assert "wrong-one" not in outcome.err
    monkeypatch.delenv("ROBOVAST_WEBDAV_USER")
    outcome = vast(*upload)
    assert outcome.code == 2
    assert "ROBOVAST_WEBDAV_USER: name of the account" in outcome.err


@pytest.mark.usefixtures("nodeless")
def test_a_failed_upload_says_what_its_pod_said(
    vast: Vast, shared: Path, known_cluster: Cluster, namespace: str
) -> None:
    inside = f"--namespace={namespace}"
    ended = {"exitCode": 65, "reason": "Error", "message": "the share is full", "startedAt": None}
    container = {"name": "share", "state": {"terminated": ended}, "image": "a", "imageID": "a"}
    status = {
        "phase": "Failed",
        "containerStatuses": [container | {"ready": False, "restartCount": 0}],
    }

    def fail() -> None:
        eventually(lambda: bool(known_cluster.get("pods", inside)["items"]))
        shown: Any = sys.stdout
        eventually(lambda: "its pod is pending: " in shown.getvalue(), told="the client is silent")
        (pod,) = known_cluster.get("pods", inside)["items"]
        known_cluster.kubectl(
            *("patch", f"pod/{pod['metadata']['name']}", inside, "--subresource=status"),
            f"--patch={json.dumps({'status': status})}",
        )

    thread = threading.Thread(target=fail)
    thread.start()
    outcome = vast("upload-to-share", "--image", "agent:1")
    thread.join()
    assert outcome.code == 2
    assert "hall-2026: its pod is pending: " in outcome.out
    assert "hall-2026 was not uploaded: the share is full\n    Its log: kubectl" in outcome.err


def test_an_unfinished_campaign_is_not_uploaded(
    vast: Vast, shared: Path, operator: Operator
) -> None:
    before = set(operator.names())
    vast("run", "--detach")
    (running,) = set(operator.names()) - before
    operator.report(running, runs={"passed": 3})
    outcome = vast("upload-to-share", "--image", "agent:1", "-i", running)
    assert outcome.code == 2
    assert f"{running} is not finished; its state is Running" in outcome.err
    outcome = vast("upload-to-share", "--image", "agent:1", "--detach")
    assert f"{running}: skipped, because it is not finished." in outcome.out
    assert "hall-2026: upload started" in outcome.out

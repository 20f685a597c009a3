"""What goes wrong on a cluster: no run is lost, none is repeated, and everybody is told why."""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robovast_testbed import images
from robovast_testbed.errors import StartFailed
from support.campaigns.local import (
    AS_NEEDED,
    DECISIONS,
    SOUND_BROKEN_MIXED,
    make_campaign,
    run,
    verdicts,
)
from support.kube.held_runs import HELD, release_until_finished
from support.kube.lab import QUICK, SYSTEM, Lab, own_operator
from support.patience import eventually

from robovast.common.execution import COMPAT_VERSION


def test_an_incompatible_image_starts_no_run_and_everybody_says_why(lab: Lab) -> None:
    path = make_campaign(lab.folder / "old", "true\n", "", QUICK)
    done = lab.vast(
        *("-V", path, "exec", "cluster", "run", "-n", lab.namespace),
        *("--image", images.WRONG_COMPAT),
        code=3,
    )
    (campaign,) = lab.get("campaigns")["items"]
    name = campaign["metadata"]["name"]
    condition = lab.conditions(name)["Succeeded"]
    assert (condition["status"], condition["reason"]) == ("False", "IncompatibleImage")
    (told,) = eventually(
        lambda: [
            event["message"]
            for event in events_of_campaigns(lab, "IncompatibleImage")
            if event["message"].startswith("The image")
        ]
    )
    for text in (condition["message"], told, done.stdout + done.stderr):
        plain = " ".join(text.split())
        assert f"version `{COMPAT_VERSION}`" in plain
        assert "version `1`" in plain
        assert images.WRONG_COMPAT in plain
        assert "container/build.sh" in plain
    statuses = [
        container
        for pod in lab.get("pods", "--selector=robovast.io/role=shard")["items"]
        for container in pod["status"].get("containerStatuses", [])
    ]
    assert not any(container.get("started") for container in statuses)


def events_of_campaigns(lab: Lab, reason: str) -> list[dict[str, Any]]:
    """What is told of Campaigns for a reason."""
    events = (e for e in lab.get("events")["items"] if e["reason"] == reason)
    return [event for event in events if event["involvedObject"]["kind"] == "Campaign"]


def run_processes(lab: Lab) -> list[int]:
    """The first processes of the namespace's run containers."""
    shards = lab.get("pods", "--selector=robovast.io/role=shard")["items"]
    hosts = {f"HOSTNAME={pod['spec']['hostname']}".encode() for pod in shards}
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            mine = hosts & set(path.read_bytes().split(b"\0"))
            status = (path.parent / "status").read_text()
            first = re.search(r"^NSpid:\t\d+\t1$", status, re.MULTILINE)
            command = (path.parent / "cmdline").read_bytes()
            if mine and first and command.startswith(b"bash\0-p\0/config/.robovast/start.sh\0"):
                found.append(int(path.parent.name))
    return found


def test_killing_the_operator_and_a_pod_loses_no_run_and_repeats_none(lab: Lab) -> None:
    """`kill -9` of the operator at ten random moments, and of one run's container."""
    chance = random.Random(7)  # noqa: S311
    with own_operator(lab) as restart:
        lab.quick("hunted", "sleep 2\n", "  runs: 5\n  runs_per_job: 3\n", parallelism=3)
        for _ in range(5):
            time.sleep(chance.uniform(0.3, 4))
            restart()
        os.kill(eventually(lambda: run_processes(lab))[0], signal.SIGKILL)
        for _ in range(5):
            time.sleep(chance.uniform(0.3, 4))
            restart()
        lab.wait("hunted", seconds=600)  # an agent waits 300 s for a dead container
    status = lab.campaign("hunted")["status"]
    assert status["runs"] | {"active": 0, "waiting": 0} == {
        "total": 15, "active": 0, "waiting": 0, "undecided": 0, "notNeeded": 0, "stored": 15,
        "passed": status["runs"]["passed"], "failed": 0, "errored": 15 - status["runs"]["passed"],
    }  # fmt: skip
    assert status["runs"]["passed"] >= 14
    home = lab.download("hunted")
    assert len(lab.verdicts(home)) == 15
    logs = "".join(p.read_text(errors="replace") for p in home.glob("_jobs/*/logs/system.log"))
    assert logs.count("Executing scenario") <= 16
    jobs = [job["metadata"]["name"] for job in lab.get("jobs")["items"]]
    assert len(jobs) == 2, "one shard and one finish Job, whoever made them"


def test_runs_as_needed_are_those_of_this_machine_whatever_is_killed(
    lab: Lab, tmp_path: Path
) -> None:
    with own_operator(lab) as restart:
        of_cluster = '[ -z "$JOB_COMPLETION_INDEX" ] || [ "$1/${3##*/}" != 3/0 ] || '
        script = f"{of_cluster}{HELD}sleep 1\n{SOUND_BROKEN_MIXED}"
        path = lab.quick("needed", script, f"{AS_NEEDED}  seed: 5\n")
        for _ in range(2):
            eventually(lambda: run_processes(lab))
            time.sleep(2)  # so that some of the runs are stored
            lab.kubectl(
                *("delete", "pods", "--selector=robovast.io/role=shard", "--force"),
                "--grace-period=0",
            )
            restart()
        release_until_finished(lab, "needed")
    seen = lab.vast("exec", "cluster", "monitor", "--once", "-n", lab.namespace).stdout
    for text in (seen, lab.kubectl("get", "campaigns", "--output=wide")):
        assert DECISIONS in text
    status = lab.campaign("needed")["status"]
    told = {key: status["runs"][key] for key in ("total", "passed", "failed", "errored")}
    assert told == {"total": 12, "passed": 5, "failed": 4, "errored": 0}
    assert (status["runs"]["notNeeded"], status["progress"]) == (3, "9/9")
    assert status["decisions"] == DECISIONS
    home = lab.download("needed")
    here = run(path, tmp_path / "here", jobs=1)
    assert lab.verdicts(home) == verdicts(here)
    assert DECISIONS in lab.vast("results", "summary", home).stdout


def test_a_container_that_is_killed_for_its_memory_costs_one_run_of_its_pack(lab: Lab) -> None:
    """Where the kernel kills single processes only, the test kills the container as it would."""
    whole = Path("/sys/fs/cgroup/cgroup.controllers").exists()
    take = 'python3 -c "a = bytearray(2 ** 30); input()"' if whole else "sleep 300"
    script = f'echo begun >"$3/begun"\n[ "$1" != 2 ] || exec {take}\n'
    lab.quick("greedy", script, "  runs_per_job: 3\n  resources: {memory: 300Mi}\n")

    def in_the_middle() -> list[int]:
        begun = "root/out/one-2/0/begun"
        return [pid for pid in run_processes(lab) if Path(f"/proc/{pid}/{begun}").exists()]

    if not whole:
        for process in eventually(in_the_middle):
            os.kill(process, signal.SIGKILL)
    lab.wait("greedy")
    home = lab.download("greedy")
    verdicts = lab.verdicts(home)
    assert verdicts == {"one-1/0": "passed", "one-2/0": "errored", "one-3/0": "passed"}
    assert (home / "one-2/0/begun").read_text() == "begun\n"
    assert (home / "one-2/0/job/logs/system.log").exists()
    assert lab.campaign("greedy")["status"]["erroredRuns"] == "1"


def test_a_run_sees_no_credentials_no_token_and_no_other_runs_results(lab: Lab) -> None:
    script = (
        'look() { ls -d "$@" 2>/dev/null; }\n'
        "{ look /robovast /var/run/secrets/kubernetes.io\n"
        '  env | grep -iE "key|token|secret"; cat /proc/*/environ 2>/dev/null | tr "\\0" "\\n" |'
        ' grep -iE "secret|accesskey"; } >"$3/seen"\n'
        'touch /config/planted 2>/dev/null && echo config >>"$3/seen"\n'
        '[ "$1" = 1 ] || for _ in $(seq 600); do\n'
        "  [ -e /out/one-1/0 ] || break; sleep 0.1\n"
        "done\n"
        'for folder in /out/one-*/0; do [ "$folder" -ef "$3" ] || touch "$folder/planted"; done\n'
        "true\n"
    )
    lab.quick("curious", script, "  runs_per_job: 3\n")
    lab.wait("curious")
    home = lab.download("curious")
    for number in (1, 2, 3):
        assert (home / f"one-{number}/0/seen").read_text() == ""
    assert not (home / "one-1/0/planted").exists(), "it was out of reach before"
    pods = lab.get("pods", "--selector=robovast.io/role=shard")["items"]
    for pod in pods:
        assert pod["spec"]["automountServiceAccountToken"] is False
        run = next(c for c in pod["spec"]["containers"] if c["name"] == "robovast")
        assert {mount["mountPath"] for mount in run["volumeMounts"]} == {"/config", "/out"}
        assert [variable["name"] for variable in run["env"]] == ["JOB_COMPLETION_INDEX"]


def malformed(good: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Campaigns with one fault each."""
    vast = good["spec"]["vast"]

    def spec(**changes: Any) -> dict[str, Any]:
        return {**good, "spec": {**good["spec"], **changes}}

    def document(**changes: Any) -> dict[str, Any]:
        changed = {k: v for k, v in {**vast, **changes}.items() if v is not None}
        return spec(vast=changed)

    def execution(**changes: Any) -> dict[str, Any]:
        return document(execution={**vast["execution"], **changes})

    def entry(**changes: Any) -> dict[str, Any]:
        return document(configuration=[{"name": "one", **changes}])

    yield "no spec", {k: v for k, v in good.items() if k != "spec"}
    yield "no document", {**good, "spec": {}}
    yield "unknown key", spec(podSpecPatch={})
    yield "version 2", document(version=2)
    yield "no version", document(version=None)
    yield "unknown section", document(excution={})
    yield "unknown execution key", execution(runz=1)
    yield "runs of no number", execution(runs="many")
    yield "no runs", execution(runs=0)
    yield "negative timeout", execution(timeout=-1)
    yield "no scenario", execution(scenario_file=None)
    yield "missing scenario", execution(scenario_file="nowhere.osc")
    yield "reserved variable", execution(env=[{"CAMPAIGN_ID": "x"}])
    yield "impossible memory", execution(resources={"memory": "8 Gigs"})
    yield "impossible cpu", execution(resources={"cpu": -1})
    yield "other cluster's cpu", execution(resources={"cpu": [{"elsewhere": 2}]})
    yield "names twice", document(configuration=[{"name": "a"}, {"name": "a"}])
    yield "name of no folder", entry(name="../up")
    yield "unknown parameter", entry(parameters=[{"nothing": 1}])
    yield "unknown variation", entry(variations=[{"NoSuchVariation": {}}])
    yield "variation without values", entry(variations=[{"ParameterVariationList": {"name": "x"}}])
    yield "search", document(configuration=None, search={"strategy": "random"})
    yield "two sources", spec(source={"inline": {}, "configMap": {"name": "a"}})
    yield "missing config map", spec(source={"configMap": {"name": "nowhere"}})
    yield "file outside", spec(source={"inline": {"files": {"../x": "y"}}})
    yield "no base64", spec(source={"inline": {"binaryFiles": {"x": "%"}}})
    yield "nothing selected", spec(select=["no-such-*"])
    yield "bad ratio", spec(acceptance={"minPassRatio": "1.5"})
    yield "bad endpoint", spec(storage={"endpoint": "s3.example.org"})
    yield "long name", {**good, "metadata": {**good["metadata"], "name": "a" * 41}}


def refused(lab: Lab, obj: dict[str, Any]) -> str | None:
    """What the API server says against an object; None when it takes it."""
    try:
        lab.kubectl("create", "--filename=-", stdin=json.dumps(obj))
    except StartFailed as error:
        return str(error)
    return None


def test_bad_input_is_refused_or_explained_and_harms_nobody_else(lab: Lab) -> None:
    """Each is refused at once, or has a condition that says why; a good one goes on beside."""
    lab.quick("good", "sleep 3\n", "  runs: 2\n", parallelism=1)
    template = lab.campaign("good")
    good = {
        "apiVersion": template["apiVersion"],
        "kind": "Campaign",
        "metadata": {"namespace": lab.namespace},
        "spec": template["spec"],
    }
    taken = {}
    for number, (fault, obj) in enumerate(malformed(good)):
        name = obj["metadata"].get("name", f"bad-{number}")
        named = {**obj, "metadata": {**obj["metadata"], "name": name}}
        refusal = refused(lab, named)
        if refusal is None:
            taken[name] = fault
        else:
            assert "invalid" in refusal.lower() or "unknown field" in refusal, refusal
    assert len(taken) < 20
    for name, fault in taken.items():
        condition = eventually(lambda name=name: lab.conditions(name).get("Accepted"), told=fault)
        assert condition["status"] == "False", (fault, condition)
        assert len(condition["message"]) > 15, (fault, condition)
        assert "Traceback" not in condition["message"]
    lab.wait("good")
    pods = json.loads(
        lab.cluster.kubectl(
            *("--namespace", SYSTEM, "get", "pods", "--selector=app=robovast-operator"),
            "--output=json",
        )
    )["items"]
    restarts = [s["restartCount"] for pod in pods for s in pod["status"]["containerStatuses"]]
    assert restarts == [0]


CAUSES: dict[str, tuple[dict[str, Any], str]] = {
    "ImagePullFailed": ({"image": "localhost:1/no/such:image"}, "localhost:1/no/such:image"),
    "ContainerConfigError": ({"storage": {"secretName": "robovast-nowhere"}}, "robovast-nowhere"),
    "Unschedulable": ({"scheduling": {"nodeSelector": {"arm": "three"}}}, "node"),
    "StorageUnavailable": ({"storage": {"endpoint": "http://127.0.0.1:9"}}, "127.0.0.1:9"),
}
"""By reason: what is wrong with a Campaign, and what is said of it."""


def test_what_does_not_start_says_why(lab: Lab) -> None:
    for reason, (spec, _) in CAUSES.items():
        lab.quick(reason.lower(), "true\n", **spec)
    for reason, (_, said) in CAUSES.items():
        name = reason.lower()
        eventually(
            lambda name=name, reason=reason: (
                lab.conditions(name).get("Stalled", {}).get("reason") == reason
            ),
            told=lambda name=name: lab.describe(name),
        )
        assert said in lab.conditions(name)["Stalled"]["message"]
        told = eventually(lambda reason=reason: events_of_campaigns(lab, reason))
        assert told[0]["type"] == "Warning"


def test_a_namespace_goes_while_its_campaign_runs(lab: Lab) -> None:
    """Kubernetes removes pods before Jobs, and a Job may hold pods that it cannot replace."""
    lab.quick("busy", "sleep 600\n")
    eventually(lambda: len(run_processes(lab)) == 3, told="three runs at once")
    lab.cluster.kubectl("delete", "namespace", lab.namespace, "--timeout=280s")
    lab.cluster.kubectl("create", "namespace", lab.namespace)

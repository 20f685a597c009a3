"""What keeps a campaign from moving on a real node: the user is told what it is."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robovast_testbed import containerd, gobuild, outages, scratch
from robovast_testbed.kubernetes import Manifest
from support.campaigns.local import make_campaign
from support.kube.admission import END, container, enforce, patch, policy
from support.kube.held_runs import HELD, release
from support.kube.lab import QUICK, SYSTEM, Lab
from support.patience import PATIENCE, eventually

FOREIGN_PROGRAM = b"\x7fELF\x02\x01\x01".ljust(16, b"\0") + (2).to_bytes(2, "little") + b"\xb7\0"
"""The beginning of an executable for aarch64; no machine of another kind executes it."""


def apply(lab: Lab, name: str, image: str) -> None:
    """Apply a campaign whose runs have an image that is none of ours."""
    made = lab.prepared(make_campaign(lab.folder / name, "true\n", "", QUICK), name, image)
    lab.kubectl("apply", "--filename=-", stdin=json.dumps(made))


def wait_stalled(lab: Lab, name: str, reason: str, seconds: float = PATIENCE) -> str:
    """Wait until a campaign says that it is stalled; returns its message."""

    def told() -> str:
        found = lab.conditions(name).get("Stalled", {})
        right = found.get("status") == "True" and found["reason"] == reason
        return found["message"] if right else ""

    message: str = eventually(told, seconds, lambda: lab.describe(name))
    return message


def wait_recovered(lab: Lab, name: str, seconds: float = PATIENCE) -> None:
    eventually(
        lambda: lab.conditions(name)["Stalled"]["status"] == "False",
        seconds,
        lambda: lab.describe(name),
    )


def test_images_that_the_node_cannot_execute_are_told(lab: Lab, tmp_path: Path) -> None:
    """One without a shell, one for another architecture."""
    engine = containerd.of(lab.cluster.bed)
    foreign = tmp_path / "of-aarch64" / "foreign"
    foreign.parent.mkdir()
    foreign.write_bytes(FOREIGN_PROGRAM.ljust(4096, b"\0"))
    engine.load(scratch.archive(foreign, "bin/sh"))
    apply(lab, "without-shell", scratch.image(gobuild.build_own("pause").name))
    apply(lab, "other-kind", scratch.image(foreign.name))
    told = wait_stalled(lab, "without-shell", "ContainerError")
    assert "/bin/sh" in told
    assert "no such file" in told
    told = wait_stalled(lab, "other-kind", "ContainerError")
    assert "exec format error" in told
    assert "architecture" in told


def test_a_container_of_ours_that_lacks_memory_is_told(lab: Lab) -> None:
    """Whenever the policy begins to hold: no later pod comes to its run."""
    paths = [f"/spec/containers/0/resources/{kind}/memory" for kind in ("limits", "requests")]
    shrink = [patch("replace", path, "24Mi") for path in paths]
    lab.cluster.apply(*policy(f"policy-{lab.namespace}", [lab.namespace], *shrink, role="shard"))
    lab.quick("small", "true\n", "  runs: 20\n", parallelism=2)
    told = wait_stalled(lab, "small", "OutOfMemory")
    assert "agent" in told


@contextmanager
def impatient_operator(lab: Lab) -> Iterator[None]:
    """The installed operator finds runs silent that write nothing for 12 s."""
    deployment = ("--namespace", SYSTEM, "deployment/robovast-operator")

    def set_minutes(value: str) -> None:
        variable = f"ROBOVAST_SILENCE_MINUTES={value}"
        lab.cluster.kubectl("set", "env", *deployment, variable)
        lab.cluster.kubectl("rollout", "status", *deployment, "--timeout=180s")

    set_minutes("0.2")
    try:
        yield
    finally:
        set_minutes("30")


def test_a_run_that_writes_nothing_is_told_and_not_ended(lab: Lab) -> None:
    # Before the scenario begins: on a busy machine its log says now and then that a tick took long.
    extra = "  runs: 1\n  pre_command: /config/files/hold.sh\n"
    path = make_campaign(lab.folder / "hangs", "true\n", extra, QUICK)
    (path.parent / "files" / "hold.sh").write_text(HELD)
    with impatient_operator(lab):
        lab.apply(path, "hangs", select=["one-1"])
        assert "kubectl logs" in wait_stalled(lab, "hangs", "NoLogOutput", 300)
        release(lab, "hangs")
    lab.wait("hangs")
    assert lab.campaign("hangs")["status"]["runs"]["passed"] == 1


def test_a_node_that_is_cut_off_is_told(lab: Lab) -> None:
    """Its pods go on, and the campaign with them, when it is back."""
    lab.quick("cut-off", HELD, "  runs: 1\n", parallelism=3)
    eventually(lambda: at_work(lab), told=lambda: lab.describe("cut-off"))
    (node,) = lab.cluster.kubectl("get", "nodes", "--output=name").split()
    with outages.paused(lab.cluster, "kubelet"):
        told = wait_stalled(lab, "cut-off", "NodeLost")
        assert node.removeprefix("node/") in told
        assert "kubectl delete node" in told
    wait_recovered(lab, "cut-off")
    release(lab, "cut-off")
    lab.wait("cut-off")
    assert lab.campaign("cut-off")["status"]["runs"]["passed"] == 3


def at_work(lab: Lab) -> bool:
    """Whether all pods of the campaign are ready."""
    jobs = lab.get("jobs", "--selector=robovast.io/campaign=cut-off")["items"]
    return any(job["status"].get("ready") == 3 for job in jobs)


EXIT = bytes.fromhex("31ff b83c000000 0f05")
"""`exit(0)` for amd64."""


def does_nothing() -> bytes:
    """An executable that ends at once, and well."""
    size = 64 + 56 + len(EXIT)
    head = struct.pack(
        "<16sHHIQQQIHHHHHH", b"\x7fELF\2\1\1", 2, 62, 1, 0x400078, 64, 0, 0, 64, 56, 1, 0, 0, 0
    )
    return head + struct.pack("<IIQQQQQQ", 1, 5, 0, 0x400000, 0x400000, size, size, 4096) + EXIT


def test_an_image_without_bash_is_told(lab: Lab, tmp_path: Path) -> None:
    """Its shell finds the right version of the contract, or would say so."""
    shell = tmp_path / "without-bash" / "shell"
    shell.parent.mkdir()
    shell.write_bytes(does_nothing())
    containerd.of(lab.cluster.bed).load(scratch.archive(shell, "bin/sh"))
    apply(lab, "no-bash", scratch.image(shell.name))
    told = wait_stalled(lab, "no-bash", "ContainerError")
    assert "Container robovast cannot start" in told
    assert '"bash"' in told


@contextmanager
def operator_with(lab: Lab, variable: str, value: str) -> Iterator[None]:
    """The installed operator with another setting, for a while."""
    deployment = ("--namespace", SYSTEM, "deployment/robovast-operator")

    def change(*words: str) -> None:
        lab.cluster.kubectl("set", "env", *deployment, *words)
        lab.cluster.kubectl("rollout", "status", *deployment, "--timeout=180s")

    (before,) = lab.cluster.kubectl(
        *("get", *deployment, "--output"),
        f"jsonpath={{..env[?(@.name=='{variable}')].value}}",
    ).splitlines() or [""]
    change(f"{variable}={value}")
    try:
        yield
    finally:
        change(f"{variable}={before}")


def test_a_pod_that_outgrows_its_disk_is_evicted_and_that_is_told(lab: Lab) -> None:
    """By the kubelet, for the limit of its volume; what it wrote is lost with it."""
    fill = 'head -c 200M /dev/zero >"$3/large"\nsleep 600\n'
    with operator_with(lab, "ROBOVAST_WORK_LIMIT", "32Mi"):
        lab.quick("large", fill, "  runs: 1\n", parallelism=1)
        told = wait_stalled(lab, "large", "Evicted", 240)
    assert "32Mi" in told


def test_a_run_that_needs_too_much_memory_says_so(lab: Lab) -> None:
    """Whether the kernel kills its container, or only the process that is too large."""
    take = 'python3 -c "a = bytearray(2 ** 30); input()"'
    lab.quick("greedy", f'[ "$1" != 2 ] || {take}\n', "  resources: {memory: 300Mi}\n")
    lab.wait("greedy")
    records = {
        path.parent.parent.name: json.loads(path.read_text())
        for path in lab.download("greedy").glob("*/*/run.json")
    }
    told = "SIGKILL: out of memory|killed a process of its job for lack of memory"
    assert re.search(told, records["one-2"]["reason"]), records["one-2"]
    assert {records[name]["verdict"] for name in ("one-1", "one-3")} == {"passed"}


BEHAVIORS = {"0": END, "1": "exit 1", "2": END, "3": "sleep 3"}
"""What a container executes that admission adds, by index of the pod: it never ends, fails, never
becomes ready, or ends."""


def mesh(*blocking: str) -> list[str]:
    """What an administrator adds to each pod, with init containers that block it."""
    index = 'object.metadata.labels[?"batch.kubernetes.io/job-completion-index"].orValue("0")'
    script = f"={json.dumps(BEHAVIORS)}[{index}]"
    never = {"exec": {"command": [f'={index} == "2" ? "false" : "true"']}}
    added = [patch("add", "/spec/containers/-", container("proxy", script, readinessProbe=never))]
    first = [container(name, END) for name in blocking]
    return [*added, *(patch("add", "/spec/initContainers/0", one) for one in first)]


def full_quota(namespace: str) -> Iterator[Manifest]:
    """A quota of everything, with a LimitRange, in a namespace of restricted pods."""
    amounts = {"cpu": "6", "memory": "12Gi", "ephemeral-storage": "20Gi"}
    hard = {f"{kind}.{k}": v for kind in ("requests", "limits") for k, v in amounts.items()}
    bounds = {
        "type": "Container",
        "min": {"cpu": "10m", "memory": "16Mi"},
        "max": {"cpu": "1", "memory": "2Gi"},
        "default": {"cpu": "200m", "memory": "256Mi", "ephemeral-storage": "500Mi"},
        "defaultRequest": {"cpu": "10m", "memory": "64Mi", "ephemeral-storage": "10Mi"},
        "maxLimitRequestRatio": {"cpu": "50", "memory": "8"},
    }
    for kind, spec in (
        ("ResourceQuota", {"hard": {**hard, "pods": "6", "count/jobs.batch": "1"}}),
        ("LimitRange", {"limits": [bounds]}),
    ):
        metadata = {"name": "bounds", "namespace": namespace}
        yield {"apiVersion": "v1", "kind": kind, "metadata": metadata, "spec": spec}


def test_a_campaign_finishes_with_added_containers_where_everything_is_limited(lab: Lab) -> None:
    """Each run once, whatever the added containers do; one that blocks pods is named."""
    lab.cluster.kubectl(
        *("label", "namespace", lab.namespace, "pod-security.kubernetes.io/enforce=restricted")
    )
    lab.cluster.apply(*full_quota(lab.namespace))
    enforce(lab, "blocker", *mesh("blocker"), role="shard")
    document = QUICK.replace("[1, 2, 3]", "[1, 2]")
    path = make_campaign(lab.folder / "meshed", "echo here\n", "  runs: 2\n", document)
    lab.apply(path, "meshed")
    told = wait_stalled(lab, "meshed", "ForeignContainer")
    assert "The container blocker in the pod meshed-" in told
    assert "not part of the campaign" in told
    shown = lab.vast("exec", "cluster", "runs", "meshed", "-n", lab.namespace).stdout
    assert "blocker" in shown
    enforce(lab, "-blocker", *mesh())
    lab.kubectl("delete", "pods", "--all", "--wait=false")
    lab.wait("meshed")
    status = lab.campaign("meshed")["status"]
    assert (status["progress"], status["runs"]["passed"]) == ("4/4", 4)
    home = lab.download("meshed")
    assert set(lab.verdicts(home).values()) == {"passed"}
    logs = [path.read_text() for path in home.glob("_jobs/*/logs/system.log")]
    assert "".join(logs).count("Executing scenario") == 4, "no run is repeated"
    records = [json.loads(path.read_text()) for path in home.glob("*/*/run.json")]
    assert all("sha256:" in record["image_digest"] for record in records)
    shown = lab.vast("exec", "cluster", "runs", "meshed", "-n", lab.namespace).stdout
    assert "4 of 4 done: 4 passed" in shown

"""What is done to a cluster while campaigns run on it: each fault lasts a bounded time, and is
repaired by who did it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from tempfile import TemporaryFile
from typing import IO, Any, TypeVar

from robovast_testbed import clocks, outages
from robovast_testbed.errors import StartFailed
from robovast_testbed.kubernetes import Cluster
from robovast_testbed.outages import Process

from robovast.kubeapi.names import child_name
from robovast.kubeapi.resources import (
    API_VERSION,
    CAMPAIGN_LABEL,
    ROLE_LABEL,
    SHARD_LABEL,
    UID_LABEL,
)
from support.gauntlet.verdict import JUMP, Excuse
from support.kube.admission import END, container, patch, policy
from support.kube.lab import SYSTEM

T = TypeVar("T")

S3_PORT = 9000
API_PORT = 6443
AT_ONCE = ("--grace-period=0", "--force")
LOOKING = 20.0
"""For how long a fault waits until somebody is there to suffer it [s]."""
LOST = 120.0
"""A node that is not heard of counts as lost by then [s]."""
SETTLING = 15.0
"""For how long a run that was hit may take until it is told to be over [s]."""


@dataclass
class Arena:
    """A cluster, and what was done to it."""

    cluster: Cluster
    files: Path
    """The root of the files that the cluster's node sees."""
    storage: Path
    """The folder of the S3 server's volume, below `files`."""
    namespaces: Sequence[str]
    campaigns: dict[tuple[str, str], dict[str, Any]] = field(default_factory=dict)
    """What the API server said last, by namespace and name."""
    excuses: list[Excuse] = field(default_factory=list)
    salts: dict[tuple[str, str], str] = field(default_factory=dict)
    """The salt of the campaign of that namespace and name."""

    def processes(self, wanted: Callable[[Sequence[str]], bool]) -> list[Process]:
        return list(outages.processes(self.cluster.bed, wanted))

    def live(self) -> list[dict[str, Any]]:
        """Campaigns that are executed."""
        return [
            obj
            for obj in self.campaigns.values()
            if obj.get("status", {}).get("state") == "Running"
        ]


Do = Callable[[Arena, Random], None]


class MissedError(Exception):
    """A fault that has changed nothing, as nobody was there to suffer it."""


def _soon(look: Callable[[], Sequence[T]]) -> Sequence[T]:
    give_up = time.monotonic() + LOOKING
    while not (found := look()):
        if time.monotonic() > give_up:
            raise MissedError
        time.sleep(0.3)
    return found


def _kill_one(arena: Arena, chance: Random, wanted: Callable[[Sequence[str]], bool]) -> None:
    chance.choice(_soon(lambda: arena.processes(wanted))).signal(signal.SIGKILL)


def kill_operator(arena: Arena, chance: Random) -> None:
    """As a process; its container starts again."""
    _kill_one(arena, chance, _is_operator)


def _is_operator(command: Sequence[str]) -> bool:
    return "robovast_operator" in command


def replace_operator(arena: Arena, chance: Random) -> None:
    """Its pod is lost; another is made while it may still live."""
    _delete_pod(arena, SYSTEM, "--selector=app=robovast-operator", *AT_ONCE)


def kill_agent(arena: Arena, chance: Random) -> None:
    """With the process that prepares runs, if they are not prepared yet."""
    agents = _soon(lambda: [p for p in arena.processes(_is_agent) if _is_first(p)])
    chance.choice(agents).signal(signal.SIGKILL)


def _is_agent(command: Sequence[str]) -> bool:
    return {"robovast.agent", "agent"} <= set(command)


def kill_preparation(arena: Arena, chance: Random) -> None:
    """The process of an agent that prepares runs, or what else begins or ends something."""
    others = {"finish", "purge", "compose"}

    def is_ours(command: Sequence[str]) -> bool:
        return "robovast.agent" in command and not others.isdisjoint(command)

    def found() -> list[Process]:
        preparing = [p for p in arena.processes(_is_agent) if not _is_first(p)]
        return [*preparing, *arena.processes(is_ours)]

    chance.choice(_soon(found)).signal(signal.SIGKILL)


def kill_run(arena: Arena, chance: Random) -> None:
    """The first process of a run's container, as when its memory is used up."""
    found = _soon(lambda: [p for p in arena.processes(_is_start) if _is_first(p)])
    process = chance.choice(found)
    host = process.environment.get("HOSTNAME", "")
    whose = [
        arena.salts[key]
        for key, obj in arena.campaigns.items()
        if key in arena.salts and host.startswith(child_name(key[1], obj["metadata"]["uid"], ""))
    ]
    now = time.time()
    process.signal(signal.SIGKILL)
    arena.excuses += [Excuse(now - 1, now + SETTLING, salt, runs=1) for salt in whose]


def _is_start(command: Sequence[str]) -> bool:
    return tuple(command[:3]) == ("bash", "-p", "/config/.robovast/start.sh")


def _is_first(process: Process) -> bool:
    with suppress(OSError):
        status = Path(f"/proc/{process.pid}/status").read_text()
        return any(
            line.startswith("NSpid:") and line.endswith("\t1") for line in status.split("\n")
        )
    return False


def evict_run(arena: Arena, chance: Random) -> None:
    """A pod of runs is told to end."""
    _delete_some_pod(arena, chance)


def forget_run(arena: Arena, chance: Random) -> None:
    """A pod of runs is taken for lost; another is made while it may still live."""
    _delete_some_pod(arena, chance, *AT_ONCE)


def _delete_some_pod(arena: Arena, chance: Random, *how: str) -> None:
    pod = chance.choice(_soon(lambda: _running(arena)))
    _delete_pod(arena, pod["metadata"]["namespace"], pod["metadata"]["name"], *how)


def _running(arena: Arena) -> list[dict[str, Any]]:
    """The pods whose runs are executed."""
    listed = arena.cluster.get("pods", "--all-namespaces", f"--selector={ROLE_LABEL}=shard")
    pods: list[dict[str, Any]] = listed["items"]  # type: ignore[assignment]
    running = [pod for pod in pods if pod["status"]["phase"] == "Running"]
    return sorted(running, key=lambda pod: str(pod["metadata"]["name"]))


def _delete_pod(arena: Arena, namespace: str, *which: str) -> None:
    words = ("delete", "pod", *which, "--wait=false", "--ignore-not-found")
    if not arena.cluster.kubectl("--namespace", namespace, *words):
        raise MissedError


def restart_part(part: str, longest: float) -> Do:
    def do(arena: Arena, chance: Random) -> None:
        outages.restart(arena.cluster, part, chance.uniform(0.2, longest))

    return do


def pause_part(part: str, shortest: float, longest: float) -> Do:
    def do(arena: Arena, chance: Random) -> None:
        with outages.paused(arena.cluster, part):
            time.sleep(chance.uniform(shortest, longest))

    return do


def _is_s3(command: Sequence[str]) -> bool:
    return command[:1] == ("versitygw",)


def replace_s3(arena: Arena, chance: Random) -> None:
    """The server's pod is killed with its process."""
    _kill_one(arena, chance, _is_s3)
    _delete_pod(arena, SYSTEM, "--selector=app=robovast-s3", *AT_ONCE)


def hang_s3(arena: Arena, chance: Random) -> None:
    with _stopped(_soon(lambda: arena.processes(_is_s3))):
        time.sleep(chance.uniform(3, 15))


def slow_s3(arena: Arena, chance: Random) -> None:
    """It works for a tenth of the time."""
    end = time.monotonic() + chance.uniform(5, 15)
    while time.monotonic() < end:
        with _stopped(_soon(lambda: arena.processes(_is_s3))):
            time.sleep(0.45)
        time.sleep(0.05)


@contextmanager
def _stopped(processes: Sequence[Process]) -> Iterator[None]:
    for process in processes:
        process.signal(signal.SIGSTOP)
    try:
        yield
    finally:
        for process in processes:
            process.signal(signal.SIGCONT)


def refuse_s3(arena: Arena, chance: Random) -> None:
    """Connections are refused, those that are open are reset."""
    rule = ("FORWARD", *_to(S3_PORT), "--jump", "REJECT", "--reject-with", "tcp-reset")
    with _filtered(arena, *rule):
        time.sleep(chance.uniform(3, 20))


def cut_s3(arena: Arena, chance: Random) -> None:
    """No packet reaches it."""
    with _filtered(arena, "FORWARD", *_to(S3_PORT), "--jump", "DROP"):
        time.sleep(chance.uniform(5, 30))


def cut_api(arena: Arena, chance: Random) -> None:
    """No packet of any pod reaches the API server."""
    with _filtered(arena, "INPUT", "--in-interface", "tb0", *_to(API_PORT), "--jump", "DROP"):
        time.sleep(chance.uniform(5, 40))


def _to(port: int) -> tuple[str, ...]:
    return ("--protocol", "tcp", "--dport", str(port))


@contextmanager
def _filtered(arena: Arena, chain: str, *rule: str) -> Iterator[None]:
    iptables = ("iptables", "--wait", "10")
    arena.cluster.bed.run(*iptables, "--insert", chain, *rule)
    try:
        yield
        listed = arena.cluster.bed.run(*iptables, "--list", chain, "1", "--verbose", "--exact")
    finally:
        arena.cluster.bed.run(*iptables, "--delete", chain, *rule)
    if listed.split()[0] == "0":  # packets
        raise MissedError


def fill_storage(arena: Arena, chance: Random) -> None:
    """The S3 server's volume is full."""
    with _full(arena.storage):
        time.sleep(chance.uniform(3, 15))


def fill_node(arena: Arena, chance: Random) -> None:
    """The disk of the node's pods is full: runs cannot write, either."""
    begin = time.time()
    try:
        with _full(arena.files / "var/lib/kubelet"):
            time.sleep(chance.uniform(2, 8))
    finally:
        arena.excuses.append(Excuse(begin, time.time() + SETTLING))


@contextmanager
def _full(folder: Path) -> Iterator[None]:
    filler = folder / "filler"
    try:
        with suppress(OSError), filler.open("wb", buffering=0) as file:
            while True:
                file.write(bytes(2**20))
        yield
    finally:
        filler.unlink(missing_ok=True)


def cut_node(arena: Arena, chance: Random) -> None:
    """Nothing is heard of the node until it counts as lost."""
    with outages.paused(arena.cluster, "kubelet"):
        give_up = time.monotonic() + LOST
        while _hears_of_node(arena):
            if time.monotonic() > give_up:
                raise MissedError
            time.sleep(1)
        time.sleep(chance.uniform(3, 20))


def _hears_of_node(arena: Arena) -> bool:
    path = '--output=jsonpath={.items[*].status.conditions[?(@.type=="Ready")].status}'
    return arena.cluster.kubectl("get", "nodes", path) == "True"


def shift_clock(wanted: Callable[[Sequence[str]], bool], seconds: int) -> Do:
    """One process's clock jumps, and later back."""

    def do(arena: Arena, chance: Random) -> None:
        process = chance.choice(_soon(lambda: arena.processes(wanted)))
        with clocks.shifted(process, seconds):
            time.sleep(chance.uniform(3, 15))

    return do


def spread_junk(arena: Arena, chance: Random) -> None:
    """Objects with our labels that nobody of us has made."""
    space = chance.choice(list(arena.namespaces))
    live = [obj for obj in arena.live() if obj["metadata"]["namespace"] == space]
    name, uid = "nobody", "none"
    if live:
        chosen = chance.choice(sorted(live, key=lambda obj: str(obj["metadata"]["name"])))
        name, uid = chosen["metadata"]["name"], chosen["metadata"]["uid"]
    mark = f"junk-{chance.randrange(16**8):08x}"
    made = 0
    for obj in _junk(chance, mark, space, name, uid):
        with suppress(StartFailed):  # refused: so much the better
            arena.cluster.kubectl("create", "--filename=-", stdin=json.dumps(obj))
            made += 1
    if not made:
        raise MissedError


def _junk(
    chance: Random, mark: str, space: str, campaign: str, uid: str
) -> Iterator[dict[str, Any]]:
    labels = {
        CAMPAIGN_LABEL: campaign,
        UID_LABEL: uid,
        ROLE_LABEL: chance.choice(["shard", "finish", "compose", "what"]),
        SHARD_LABEL: chance.choice(["x", "-1", "0", "99999999999999999999", "1.5"]),
        "app.kubernetes.io/managed-by": "robovast",
    }
    texts = ["", "x", "1-", "5-1", "0-99999999999", "nan", '{"a":', "\u2028"]
    annotations = {
        "robovast.io/runs": chance.choice(texts),
        "robovast.io/attempt": chance.choice(texts),
    }
    metadata = {"name": mark, "namespace": space, "labels": labels, "annotations": annotations}
    pod = {
        "restartPolicy": "Never",
        "nodeSelector": {"there-is": "none"},
        "containers": [{"name": "agent", "image": "none:none"}],
    }
    template = {"metadata": {"labels": labels, "annotations": annotations}, "spec": pod}
    job = {"template": template, "suspend": chance.random() < 0.5}
    yield {"apiVersion": "batch/v1", "kind": "Job", "metadata": metadata, "spec": job}
    yield {"apiVersion": "v1", "kind": "Pod", "metadata": metadata, "spec": pod}
    data = {"campaign.json": chance.choice(texts), "document.vast": chance.choice(texts)}
    yield {"apiVersion": "v1", "kind": "ConfigMap", "metadata": metadata, "data": data}
    entry = {"campaign": "nobody", "parameters": [{chance.choice(texts): chance.choice(texts)}]}
    yield {"apiVersion": API_VERSION, "kind": "Configuration", "metadata": metadata, "spec": entry}
    vast = {
        "version": 1,
        "configuration": [{"name": "a"}],
        "execution": {"scenario_file": "no.osc"},
    }
    yield {
        "apiVersion": API_VERSION,
        "kind": "Campaign",
        "metadata": metadata,
        "spec": {"vast": vast},
    }


MESH = {"never ends": END, "fails": "sleep 1; exit 1", "ends": "sleep 1"}
"""What an added container executes."""


def inject_sidecar(arena: Arena, chance: Random) -> None:
    """Admission adds a container to each new pod of campaigns."""
    script = MESH[chance.choice(sorted(MESH))]
    added = patch("add", "/spec/containers/-", container("proxy", script))
    arena.cluster.apply(*policy("gauntlet", arena.namespaces, added))
    try:
        _soon(lambda: [pod for pod in _running(arena) if _has_container(pod, "proxy")])
        time.sleep(chance.uniform(3, 15))
    finally:
        kinds = "mutatingadmissionpolicybindings,mutatingadmissionpolicies"
        arena.cluster.kubectl("delete", kinds, "gauntlet")


def _has_container(pod: dict[str, Any], name: str) -> bool:
    return any(found["name"] == name for found in pod["spec"]["containers"])


def add_operator(arena: Arena, chance: Random) -> None:
    """A second installation works in the same namespaces, with the same settings."""
    deployment: Any = arena.cluster.get("deployment", "robovast-operator", f"--namespace={SYSTEM}")
    (first,) = deployment["spec"]["template"]["spec"]["containers"]
    given = {one["name"]: one.get("value", "") for one in first["env"] if "valueFrom" not in one}
    own = {"POD_NAMESPACE": "default", "POD_NAME": "second", "ROBOVAST_PORT": "0"}
    with TemporaryFile("w+") as log:
        second = subprocess.Popen(
            [sys.executable, "-m", "robovast_operator"],
            env={**os.environ, **arena.cluster.env, **given, **own},
            stderr=log,
        )
        try:
            _soon(lambda: _lines(log))
            time.sleep(chance.uniform(3, 15))
        finally:
            second.kill()
            second.wait()


def _lines(log: IO[str]) -> list[str]:
    """What an operator reports of another one, or of itself."""
    log.seek(0)
    return [line for line in log if "Another RoboVAST operator" in line or " leads" in line]


FAULTS: dict[str, Do] = {
    "operator killed": kill_operator,
    "operator's pod lost": replace_operator,
    "agent killed": kill_agent,
    "preparation, finish or purge killed": kill_preparation,
    "run's container killed": kill_run,
    "run's pod told to end": evict_run,
    "run's pod lost": forget_run,
    "kubelet killed": restart_part("kubelet", 10),
    "containerd killed": restart_part("containerd", 5),
    "API server killed": restart_part("kube-apiserver", 5),
    "etcd killed": restart_part("etcd", 3),
    "etcd hangs": pause_part("etcd", 2, 10),
    "scheduler killed": restart_part("kube-scheduler", 5),
    "controller manager killed": restart_part("kube-controller-manager", 5),
    "S3 killed": replace_s3,
    "S3 hangs": hang_s3,
    "S3 slow": slow_s3,
    "S3 refuses": refuse_s3,
    "S3 cut off": cut_s3,
    "S3's disk full": fill_storage,
    "node's disk full": fill_node,
    "API server cut off from pods": cut_api,
    "node cut off": cut_node,
    "operator's clock an hour ahead": shift_clock(_is_operator, JUMP),
    "operator's clock an hour behind": shift_clock(_is_operator, -JUMP),
    "agent's clock an hour ahead": shift_clock(_is_agent, JUMP),
    "agent's clock an hour behind": shift_clock(_is_agent, -JUMP),
    "malformed objects": spread_junk,
    "injected sidecar": inject_sidecar,
    "second operator with the same scope": add_operator,
}
"""What each does, by name."""

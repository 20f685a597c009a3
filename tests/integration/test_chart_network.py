"""Who reaches whom under the chart's NetworkPolicies; no plugin of the testbed enforces them."""

from __future__ import annotations

from typing import Any

import pytest
from support.kube.chart import Object, of_kind, rendered
from support.kube.fake_cluster import SETTINGS, accepted
from support.kube.network_rules import Peer, lets_through

from robovast.kubeapi.share_job import Upload, share_job
from robovast_operator.planning.revisions import next_revision
from robovast_operator.planning.shards import first_attempts
from robovast_operator.pods.jobs import shard_job, task_job

OPERATOR = Peer("system", {"app": "robovast-operator"}, {"http": 8080})
S3 = Peer("system", {"app": "robovast-s3"}, {"s3": 9000})
PAGE = Peer("system", {"app": "robovast-page"})


def of_campaign(namespace: str, job: dict[str, Any]) -> Peer:
    return Peer(namespace, job["spec"]["template"]["metadata"]["labels"])


(SHARD,) = first_attempts(accepted().identity, [next_revision(accepted(), (), (), "plan-0")])
RUN = of_campaign("a", shard_job(accepted(), SETTINGS, SHARD))
FINISH = of_campaign("b", task_job(accepted(), SETTINGS, "finish", "finish", "plan-0"))
COMPOSE, PROCESS, PURGE = (
    of_campaign("a", task_job(accepted(), SETTINGS, command, command, "plan-0"))
    for command in ("compose", "process", "purge")
)
NOTIFY = Peer("a", {"robovast.io/role": "notify"})
UPLOAD = of_campaign("a", share_job(Upload("drive", "drive", "http://s3:9000", "agent:1"), "share"))
STRANGER = Peer("other", {"app": "anything"})
NEIGHBOUR = Peer("system", {"app": "anything"})
PROMETHEUS = Peer("monitoring", {"app": "prometheus"})
DNS = Peer("kube-system", {"k8s-app": "kube-dns"})
SERVER = Peer("10.0.0.0/24")
WORLD = Peer("203.0.113.0/24")


def reaches(values: Object, source: Peer, target: Peer, port: int, protocol: str = "TCP") -> bool:
    policies = list(
        of_kind(rendered({"page": {"enabled": True}, **values}), "NetworkPolicy").values()
    )
    return lets_through(policies, "system", source, target, port, protocol)


RUNS = {"networkPolicy": {"runs": True}, "storage": {"credentials": {"namespaces": ["a"]}}}
EXTERNAL: Object = {
    "storage": {
        "embedded": {"enabled": False},
        "external": {"endpoint": "http://s3.example.org:9123"},
        "credentials": {"namespaces": ["a"]},
    },
    "networkPolicy": {"runs": True, "storage": ["10.0.0.0/24"], "apiServer": ["10.0.0.0/24"]},
}
ADDRESSES = {key: ["10.0.0.0/24"] for key in ("git", "notify", "share")}
NAMED: Object = {**RUNS, "networkPolicy": {"runs": True, **ADDRESSES}}
NARROW = {"metrics": {"namespaces": ["monitoring"]}, "operator": {"namespaces": ["a"]}}


@pytest.mark.parametrize(
    ("values", "source", "target", "port", "expected"),
    [
        ({}, OPERATOR, SERVER, 6443, True),
        ({}, OPERATOR, SERVER, 443, True),
        ({}, OPERATOR, WORLD, 80, False),
        ({}, OPERATOR, S3, 9000, False),
        ({}, PROMETHEUS, OPERATOR, 8080, True),
        ({}, PROMETHEUS, OPERATOR, 22, False),
        ({"metrics": {"enabled": False}}, PROMETHEUS, OPERATOR, 8080, False),
        (NARROW, PROMETHEUS, OPERATOR, 8080, True),
        (NARROW, STRANGER, OPERATOR, 8080, False),
        ({}, RUN, S3, 9000, True),
        ({}, FINISH, S3, 9000, True),
        ({}, UPLOAD, S3, 9000, True),
        ({}, PAGE, S3, 9000, True),
        ({}, STRANGER, S3, 9000, False),
        ({}, NEIGHBOUR, S3, 9000, False),
        (NARROW, RUN, S3, 9000, True),
        (NARROW, FINISH, S3, 9000, False),
        ({}, S3, WORLD, 443, False),
        ({}, PAGE, WORLD, 443, False),
        ({}, STRANGER, PAGE, 8400, False),
        ({}, RUN, WORLD, 443, True),
        (RUNS, RUN, WORLD, 443, False),
        (RUNS, RUN, S3, 9000, True),
        (RUNS, STRANGER, RUN, 80, False),
        *((RUNS, pod, S3, 9000, True) for pod in (COMPOSE, PROCESS, PURGE, UPLOAD)),
        *((RUNS, pod, WORLD, 443, False) for pod in (COMPOSE, PROCESS, PURGE)),
        *((RUNS, STRANGER, pod, 80, False) for pod in (COMPOSE, PROCESS, PURGE, UPLOAD, NOTIFY)),
        (RUNS, FINISH, WORLD, 443, True),  # no policy was asked for in that namespace
        (RUNS, UPLOAD, WORLD, 443, True),
        (RUNS, UPLOAD, WORLD, 22, True),
        (RUNS, UPLOAD, WORLD, 25, False),
        (RUNS, NOTIFY, WORLD, 443, True),
        (RUNS, NOTIFY, WORLD, 22, False),
        (RUNS, NOTIFY, S3, 9000, False),
        (NAMED, NOTIFY, SERVER, 8065, True),
        (NAMED, NOTIFY, WORLD, 443, False),
        (NAMED, UPLOAD, SERVER, 2222, True),
        (NAMED, UPLOAD, WORLD, 443, False),
        (NAMED, RUN, SERVER, 443, True),
        (NAMED, COMPOSE, SERVER, 443, True),
        (NAMED, PURGE, SERVER, 443, False),
        (NAMED, RUN, WORLD, 443, False),
        (EXTERNAL, RUN, SERVER, 9123, True),
        (EXTERNAL, RUN, SERVER, 443, False),
        (EXTERNAL, RUN, WORLD, 9123, False),
        (EXTERNAL, PAGE, SERVER, 9123, True),
        (EXTERNAL, OPERATOR, SERVER, 443, True),
        (EXTERNAL, OPERATOR, WORLD, 443, False),
        ({"networkPolicy": {"enabled": False}}, STRANGER, S3, 9000, True),
    ],
)
def test_pods_reach_what_they_need_and_nothing_else(
    values: Any, source: Peer, target: Peer, port: int, *, expected: bool
) -> None:
    assert reaches(values, source, target, port) is expected


@pytest.mark.parametrize("source", [OPERATOR, PAGE, RUN, COMPOSE, PROCESS, PURGE, UPLOAD, NOTIFY])
def test_names_can_be_looked_up_by_the_clusters_dns_alone(source: Peer) -> None:
    for protocol in ("UDP", "TCP"):
        assert reaches(RUNS, source, DNS, 53, protocol)
        for other in (WORLD, SERVER, NEIGHBOUR):
            assert not reaches(RUNS, source, other, 53, protocol)
    assert not reaches(RUNS, source, DNS, 54, "UDP")


def test_a_cluster_with_another_dns_names_it() -> None:
    cache = Peer("169.254.20.10/32")
    named = {"networkPolicy": {"runs": True, "dns": [{"ipBlock": {"cidr": "169.254.20.10/32"}}]}}
    assert reaches({**RUNS, **named}, RUN, cache, 53, "UDP")
    assert not reaches({**RUNS, **named}, RUN, DNS, 53, "UDP")

"""Fixtures: real engines for a test session, or a skip that says what the machine lacks."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from . import bed, controlplane, docker, gcs, images, kubernetes, kueue, network, node, programs, s3
from .errors import Unavailable


@contextmanager
def skipped_when_unavailable() -> Iterator[None]:
    """Turn a machine that cannot host the testbed into a skip; in CI it is a failure.

    With ``ROBOVAST_TESTBED=off`` it is a skip everywhere.
    """
    try:
        yield
    except Unavailable as missing:
        if os.environ.get("CI") == "true" and os.environ.get("ROBOVAST_TESTBED") != "off":
            raise
        pytest.skip(str(missing))


@contextmanager
def _session(kind: str) -> Iterator[bed.Bed]:
    with skipped_when_unavailable(), bed.session(f"pytest-{os.getpid()}-{kind}") as own:
        yield own


@pytest.fixture(scope="session")
def docker_daemon() -> Iterator[docker.Docker]:
    """A Docker daemon of this session's own.

    ``ROBOVAST_TESTBED_DOCKER=NAME`` uses the one that ``tests/testbed/up docker --name NAME``
    has left running instead, which saves its start.
    """
    kept = os.environ.get("ROBOVAST_TESTBED_DOCKER")
    if kept:
        yield docker.attach(bed.Bed(kept))
        return
    with _session("docker") as own:
        yield docker.start(own)


@pytest.fixture(scope="session")
def slim_image(docker_daemon: docker.Docker) -> str:
    """The name of the run image without ROS, built from container/slim."""
    with skipped_when_unavailable():
        images.load(docker_daemon, images.archive())
    return images.SLIM


@pytest.fixture(scope="session")
def ros_image(docker_daemon: docker.Docker) -> str:
    """The name of the run image with ROS 2's wheels, built from container/slim."""
    with skipped_when_unavailable():
        images.load(docker_daemon, images.ros_archive())
    return images.ROS


@pytest.fixture(scope="session")
def wrong_compat_image(slim_image: str) -> str:
    """The name of a run image whose compatibility version is 1."""
    return images.WRONG_COMPAT


@pytest.fixture(scope="session")
def no_compat_image(slim_image: str) -> str:
    """The name of a run image that states no compatibility version."""
    return images.NO_COMPAT


@pytest.fixture(scope="session")
def control_plane() -> Iterator[kubernetes.Cluster]:
    """A real API server with its controllers and scheduler, without nodes."""
    with _session("control-plane") as own:
        yield controlplane.start(own)


@pytest.fixture(scope="session")
def oldest_control_plane() -> Iterator[kubernetes.Cluster]:
    """The same of the oldest Kubernetes that is promised."""
    with _session("oldest-control-plane") as own:
        yield controlplane.start(own, version=programs.OLDEST_KUBERNETES)


@pytest.fixture(scope="session")
def cluster() -> Iterator[kubernetes.Cluster]:
    """A real cluster of one real node, whose containerd has the run images.

    ``ROBOVAST_TESTBED_CLUSTER=NAME`` uses the one that ``tests/testbed/up --name NAME`` has left
    running instead, which saves its start.
    """
    kept = os.environ.get("ROBOVAST_TESTBED_CLUSTER")
    if kept:
        yield kubernetes.Cluster(bed.Bed(kept))
        return
    with _session("cluster") as own:
        made = controlplane.start(own)
        node.start(made, [images.archive()])
        yield made


@pytest.fixture(scope="session")
def kueue_cluster(cluster: kubernetes.Cluster) -> kubernetes.Cluster:
    """The real cluster with Kueue installed."""
    with skipped_when_unavailable():
        kueue.install(cluster)
    return cluster


@pytest.fixture(scope="session", params=sorted(s3.MAKES))
def s3_server(request: pytest.FixtureRequest) -> Iterator[s3.Server]:
    """An object store; a test that asks for it runs once with each make."""
    with _session(f"s3-{request.param}") as own:
        network.create_bridge(own)
        yield s3.start(own, request.param)


@pytest.fixture(scope="session")
def gcs_server() -> Iterator[str]:
    """HOST:PORT of a server that speaks the API of Google Cloud Storage."""
    with skipped_when_unavailable(), gcs.started() as address:
        yield address

"""Fixtures that tests of every kind may ask for."""

from robovast_testbed.pytest_plugin import docker_daemon

__all__ = ["docker_daemon"]

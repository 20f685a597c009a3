"""Fixtures that tests of every kind may ask for."""

from robovast_testbed.pytest_plugin import (
    docker_daemon,
    no_compat_image,
    slim_image,
    wrong_compat_image,
)

__all__ = ["docker_daemon", "no_compat_image", "slim_image", "wrong_compat_image"]

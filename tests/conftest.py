"""Fixtures that tests of every kind may ask for."""

from robovast_testbed.pytest_plugin import (
    control_plane,
    docker_daemon,
    no_compat_image,
    s3_server,
    slim_image,
    wrong_compat_image,
)

__all__ = [
    "control_plane",
    "docker_daemon",
    "no_compat_image",
    "s3_server",
    "slim_image",
    "wrong_compat_image",
]

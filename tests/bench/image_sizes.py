#!/usr/bin/env python3
"""What our images add to their base, as Docker counts it.

    PYTHONPATH=src:tests:tests/testbed python tests/bench/image_sizes.py

Builds the images on the base of the tests, in a Docker daemon of its own, and prints MB (10⁶ byte).
The image with ROS 2 is missing: its base and its packages come from registries.
"""

from __future__ import annotations

import os
import shutil

from robovast_testbed import bed, docker, images
from robovast_testbed.commands import run

CORE = f"{images.REPOSITORY}:core-agent"


def build_core(engine: docker.Docker, own: bed.Bed) -> None:
    """The agent's image with `--core`, from the wheels of the whole one."""
    context = own.folder / "context"
    shutil.copytree(images.ROOT, context, ignore=shutil.ignore_patterns(".*", "node_modules"))
    shutil.copytree(images._agent_wheels(), context / "container/agent/wheels")
    words = ("--agent", "--core", "--base", images.BASE, "--tag", "core")
    command = [context / "container/build.sh", *words, "--", *images._OFFLINE]
    run(command, env=os.environ | engine.env)


def main() -> None:
    with bed.session(f"image-sizes-{os.getpid()}") as own:
        engine = docker.start(own)

        def size(image: str) -> float:
            return int(engine.run("image", "inspect", "--format", "{{.Size}}", image)) / 1e6

        archives = (images._agent_base(), images.agent_archive())
        for archive in (*archives, images.archive(), images.ros_archive()):
            engine.run("load", "--quiet", "--input", archive)
        build_core(engine, own)
        base = size(images.BASE)
        named = {
            "slim": images.SLIM,
            "slim with ROS_WHEELS=true": images.ROS,
            "agent": images.AGENT,
            "agent with --core": CORE,
        }
        for name, image in named.items():
            print(f"{name}: {size(image) - base:.0f} MB on a base of {base:.0f} MB")


if __name__ == "__main__":
    main()

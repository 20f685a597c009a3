"""The images that tests run, built from container/ on a base of our own, without a registry.

Every run image comes in three kinds: as users have it, with a wrong compatibility version, and
with none. All are built once and kept as one archive, which Docker and containerd load.
"""

import os
import shutil
from pathlib import Path

from . import bed, cache, debian, docker, gobuild, programs
from .commands import run
from .errors import Unavailable

REPOSITORY = "localhost:5000/robovast"  # where container/build.sh puts its images
SLIM = f"{REPOSITORY}:testbed-slim"
WRONG_COMPAT = f"{REPOSITORY}:testbed-wrong-compat"
NO_COMPAT = f"{REPOSITORY}:testbed-no-compat"

ROS = f"{REPOSITORY}:testbed-ros-slim"
AGENT = f"{REPOSITORY}:testbed-agent"
S3 = f"{REPOSITORY}:testbed-s3"

ROOT = Path(__file__).parents[3]
CONTAINER = ROOT / "container"
BASE = f"{REPOSITORY}-testbed-base:{debian.SUITE}"
COMPAT_FILE = "/etc/robovast_compat_version"
SPOILT = {
    WRONG_COMPAT: f'echo "1" > {COMPAT_FILE}',
    NO_COMPAT: f"rm {COMPAT_FILE}",
}


def archive() -> Path:
    """Return the cached archive of all run images, built when container/ has changed.

    :raises Unavailable: when the machine cannot build it.
    """

    def make(folder: Path) -> None:
        with bed.session(f"images-{os.getpid()}") as scratch:
            _build(docker.start(scratch), scratch.folder / "context", folder / "images.tar")

    recipe = [CONTAINER / "slim", CONTAINER / "build.sh", Path(__file__)]
    key = cache.digest(recipe, debian.SUITE, debian.ROOTFS_VERSION)
    return cache.once(f"images/{key}", make) / "images.tar"


def ros_archive() -> Path:
    """Return the cached archive of the slim run image with ROS 2's wheels.

    :raises Unavailable: when the machine cannot build it.
    """

    def make(folder: Path) -> None:
        with bed.session(f"ros-{os.getpid()}") as scratch:
            engine, context = docker.start(scratch), scratch.folder / "context"
            _build_slim(engine, context, "testbed-ros", "requirements-ros.txt", "ROS_WHEELS=true")
            engine.run("save", "--output", folder / "images.tar", ROS)

    recipe = [CONTAINER / "slim", CONTAINER / "build.sh"]
    key = cache.digest(recipe, debian.SUITE, debian.ROOTFS_VERSION)
    return cache.once(f"images/ros-{key}", make) / "images.tar"


def agent_archive() -> Path:
    """Return the cached archive of our own image and of an S3 gateway's, built when code changes.

    :raises Unavailable: when the machine cannot build it.
    """

    def make(folder: Path) -> None:
        cache.forget(f"images/agent-{'[0-9a-f]' * 16}", _KEPT)
        with bed.session(f"agent-{os.getpid()}") as scratch:
            _build_agent(docker.start(scratch), scratch.folder / "context", folder / "images.tar")

    code = [ROOT / name for name in ("src", "cli", "operator", "helm", "pyproject.toml")]
    recipe = [CONTAINER / "agent/Dockerfile", CONTAINER / "build.sh", _LOCK, Path(__file__)]
    key = cache.digest(
        [*code, *recipe], debian.SUITE, debian.ROOTFS_VERSION, programs.VERSITYGW.version
    )
    return cache.once(f"images/agent-{key}", make) / "images.tar"


_KEPT = 2 * 3600.0
"""How long an image of older code is kept [s]: as long as tests of it take; it is large."""
_LOCK = ROOT / "requirements/agent.txt"
_DEPENDENCIES = f"{REPOSITORY}-testbed-agent-dependencies:{debian.SUITE}"
_OFFLINE = (
    *("--network", "none"),
    *("--build-arg", "PIP_NO_INDEX=1", "--build-arg", "PIP_FIND_LINKS=/build/wheels"),
)


def _build_agent(engine: docker.Docker, context: Path, output: Path) -> None:
    engine.run("load", "--quiet", "--input", _agent_base())
    ignored = shutil.ignore_patterns("__pycache__", ".*", "node_modules", "tests")
    shutil.copytree(ROOT, context, ignore=ignored)
    shutil.copytree(_agent_wheels(), context / "container/agent/wheels")
    build = context / "container/build.sh"
    options = ("--cache-from", _DEPENDENCIES, *_OFFLINE)  # which saves their installation
    run(
        [build, "--agent", "--base", BASE, "--tag", "testbed", "--", *options],
        env=os.environ | engine.env,
    )
    engine.run("save", "--output", output, AGENT, S3)


def _agent_base() -> Path:
    """Return the cached archive of what changes seldom: base, dependencies, S3 gateway."""

    def make(folder: Path) -> None:
        with bed.session(f"agent-base-{os.getpid()}") as scratch:
            engine, context = docker.start(scratch), scratch.folder / "context"
            engine.run("import", debian.rootfs(), BASE)
            shutil.copytree(CONTAINER / "agent", context)
            shutil.copy(_LOCK, context / "requirements.txt")
            shutil.copytree(_agent_wheels(), context / "wheels")
            options = ("--build-arg", f"BASE_IMAGE={BASE}", "--target", "dependencies", *_OFFLINE)
            engine.run("build", *options, "--tag", _DEPENDENCIES, context)
            _build_s3(engine, scratch.folder / "s3")
            engine.run("save", "--output", folder / "images.tar", BASE, _DEPENDENCIES, S3)

    recipe = [CONTAINER / "agent/Dockerfile", _LOCK]
    versions = (debian.SUITE, debian.ROOTFS_VERSION, programs.VERSITYGW.version)
    return cache.once(f"images/agent-base-{cache.digest(recipe, *versions)}", make) / "images.tar"


def _agent_wheels() -> Path:
    def make(folder: Path) -> None:
        _download([_LOCK], folder)

    return cache.once(f"wheels/{cache.digest([_LOCK], debian.PYTHON)}", make)


def _build_s3(engine: docker.Docker, context: Path) -> None:
    """The S3 gateway that the chart installs, as an image that needs no registry."""
    context.mkdir()
    shutil.copy(gobuild.build(programs.VERSITYGW), context / "versitygw")
    recipe = f"FROM {BASE}\nCOPY versitygw /usr/local/bin/\nUSER 1000\n"
    (context / "Dockerfile").write_text(recipe)
    engine.run("build", "--network", "none", "--tag", S3, context)


def load(engine: docker.Docker, path: Path) -> None:
    """Give a Docker daemon the images of an archive, unless it has them."""
    stamp = engine.folder / f"loaded-{path.parent.name}"
    if not stamp.exists():
        engine.run("load", "--quiet", "--input", path)
        stamp.touch()


def _build_slim(
    engine: docker.Docker, context: Path, tag: str, requirements: str, *arguments: str
) -> None:
    """Build container/slim as `TAG-slim`, without a network."""
    engine.run("import", debian.rootfs(), BASE)
    shutil.copytree(CONTAINER, context)
    slim = context / "slim"
    _download([slim / "requirements-build.txt", slim / requirements], slim / "wheels")
    given = [word for argument in arguments for word in ("--build-arg", argument)]
    run(
        [context / "build.sh", "--slim", "--base", BASE, "--tag", tag, "--", *_OFFLINE, *given],
        env=os.environ | engine.env,
    )


def _build(engine: docker.Docker, context: Path, output: Path) -> None:
    _build_slim(engine, context, "testbed", "requirements.txt")
    for image, command in SPOILT.items():
        recipe = f"FROM {SLIM}\nUSER 0\nRUN {command}\nUSER 1000\n"
        spoilt = context / "spoilt"
        spoilt.mkdir(exist_ok=True)
        (spoilt / "Dockerfile").write_text(recipe)
        engine.run("build", "--network", "none", "--tag", image, spoilt)
    engine.run("save", "--output", output, SLIM, *SPOILT)


def _download(requirements: list[Path], folder: Path) -> None:
    """Download locked packages for the base's Python."""
    pip = shutil.which("pip") or shutil.which("pip3")
    if pip is None:
        raise Unavailable("the testbed needs pip, to fetch what its images install")
    tags = ("manylinux_2_28", "manylinux_2_27", "manylinux2014", "manylinux_2_17")
    run(
        [
            *(pip, "download", "--quiet", "--no-deps", "--require-hashes"),
            *(word for file in requirements for word in ("--requirement", file)),
            *("--python-version", debian.PYTHON, "--dest", folder),
            *(word for tag in tags for word in ("--platform", f"{tag}_{os.uname().machine}")),
        ]
    )

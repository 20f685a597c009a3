"""The images that tests run, built from container/ on a base of our own, without a registry.

Every run image comes in three kinds: as users have it, with a wrong compatibility version, and
with none. All are built once and kept as one archive, which Docker and containerd load.
"""

import os
import shutil
from pathlib import Path

from . import bed, cache, debian, docker
from .commands import run
from .errors import Unavailable

REPOSITORY = "localhost:5000/robovast"  # where container/build.sh puts its images
SLIM = f"{REPOSITORY}:testbed-slim"
WRONG_COMPAT = f"{REPOSITORY}:testbed-wrong-compat"
NO_COMPAT = f"{REPOSITORY}:testbed-no-compat"

CONTAINER = Path(__file__).parents[3] / "container"
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


def load(engine: docker.Docker) -> None:
    """Give a Docker daemon the run images, unless it has them."""
    path = archive()
    stamp = engine.folder / f"loaded-{path.parent.name}"
    if not stamp.exists():
        engine.run("load", "--quiet", "--input", path)
        stamp.touch()


def _build(engine: docker.Docker, context: Path, output: Path) -> None:
    engine.run("import", debian.rootfs(), BASE)
    shutil.copytree(CONTAINER, context)
    _fetch_wheels(context / "slim")
    run(
        [
            *(context / "build.sh", "--slim", "--base", BASE, "--tag", "testbed"),
            *("--", "--network", "none"),
            *("--build-arg", "PIP_NO_INDEX=1", "--build-arg", "PIP_FIND_LINKS=/build/wheels"),
        ],
        env=os.environ | engine.env,
    )
    for image, command in SPOILT.items():
        recipe = f"FROM {SLIM}\nUSER 0\nRUN {command}\nUSER 1000\n"
        spoilt = context / "spoilt"
        spoilt.mkdir(exist_ok=True)
        (spoilt / "Dockerfile").write_text(recipe)
        engine.run("build", "--network", "none", "--tag", image, spoilt)
    engine.run("save", "--output", output, SLIM, *SPOILT)


def _fetch_wheels(folder: Path) -> None:
    """Download what the slim image installs, for the base's Python, into `wheels/`."""
    pip = shutil.which("pip") or shutil.which("pip3")
    if pip is None:
        raise Unavailable("the testbed needs pip, to fetch what its images install")
    files = (folder / "requirements-build.txt", folder / "requirements.txt")
    tags = ("manylinux_2_28", "manylinux_2_27", "manylinux2014")
    run(
        [
            *(pip, "download", "--quiet", "--no-deps", "--require-hashes"),
            *(word for file in files for word in ("--requirement", file)),
            *("--python-version", debian.PYTHON, "--dest", folder / "wheels"),
            *(word for tag in tags for word in ("--platform", f"{tag}_{os.uname().machine}")),
        ]
    )

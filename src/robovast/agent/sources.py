"""The files that belong to a document, from wherever they are."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tarfile
from io import BytesIO
from pathlib import Path

from robovast.agent.folders import Folders
from robovast.cluster.plan import Bundle, CampaignPlan, GitSource
from robovast.cluster.storage import EXECUTABLE, ObjectStore
from robovast.errors import InputError, StorageError


def copy_inputs(plan: CampaignPlan, folders: Folders, store: ObjectStore, target: Path) -> None:
    """Copy a document's files into an empty folder.

    Raises:
        InputError: they are not what the plan says.
        StorageError: they cannot be fetched.
    """
    if plan.bundle is not None:
        _unpack(plan.bundle, store, target)
    elif plan.git is not None:
        _checkout(plan.git, folders.scratch / "repository", target)
    elif folders.files.is_dir():
        _copy_mounted(folders.files, target)


def _copy_mounted(source: Path, target: Path) -> None:
    """Copy a mounted ConfigMap without the links that it is made of.

    It knows no modes: what begins with `#!` can be executed.
    """
    for folder, subfolders, names in os.walk(source, followlinks=True):
        subfolders[:] = [name for name in subfolders if not name.startswith("..")]
        there = target / Path(folder).relative_to(source)
        there.mkdir(parents=True, exist_ok=True)
        for name in names:
            if not name.startswith(".."):
                shutil.copyfile(Path(folder) / name, there / name)
                _make_executable(there / name)


def _make_executable(path: Path) -> None:
    with path.open("rb") as file:
        if file.read(2) == b"#!":
            path.chmod(EXECUTABLE)


def _unpack(bundle: Bundle, store: ObjectStore, target: Path) -> None:
    content = store.read(bundle.bucket, bundle.key)
    name = f"{bundle.bucket}/{bundle.key}"
    if content is None:
        raise InputError(f"the archive of the document's files, {name}, does not exist.")
    found = hashlib.sha256(content).hexdigest()
    if found != bundle.sha256:
        raise InputError(f"{name}: its SHA-256 is {found}; the campaign wants {bundle.sha256}.")
    try:
        with tarfile.open(fileobj=BytesIO(content)) as archive:
            archive.extractall(target, filter="data")
    except (tarfile.TarError, EOFError, OSError) as error:
        raise InputError(f"{name}: cannot be unpacked: {error}") from error


def _checkout(git: GitSource, repository: Path, target: Path) -> None:
    shutil.rmtree(repository, ignore_errors=True)
    repository.mkdir(parents=True)
    for arguments in (
        ("init", "--quiet"),
        ("fetch", "--quiet", "--depth=1", "--", git.url, git.ref),
        ("checkout", "--quiet", "FETCH_HEAD"),
    ):
        result = subprocess.run(
            ["git", *arguments],
            cwd=repository,
            env={**os.environ, "GIT_TERMINAL_PROMPT": "0"},
            capture_output=True,
            text=True,
            check=False,
        )
        if result.returncode:
            cause = result.stderr.strip() or f"git ended with code {result.returncode}"
            raise StorageError(f"{git.url}: `{git.ref}` cannot be fetched: {cause}")
    folder = Path(os.path.normpath(repository / git.path))
    if not folder.is_relative_to(repository) or not folder.is_dir():
        raise InputError(f"{git.url}: `{git.ref}` has no folder `{git.path}`.")
    shutil.copytree(
        folder, target, dirs_exist_ok=True, symlinks=True, ignore=shutil.ignore_patterns(".git")
    )

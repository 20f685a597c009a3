"""Fetches the files that belong to a document, from any kind of source."""

from __future__ import annotations

import hashlib
import os
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from math import inf
from pathlib import Path
from urllib.parse import urlsplit

from robovast.agent.mounts import Folders
from robovast.base.errors import InputError, StorageError
from robovast.kubeapi.pod_contract.packed import PACKED, unpack
from robovast.model.packs import Bundle, CampaignPlan, GitSource
from robovast.storage.s3 import EXECUTABLE, ObjectStore


def copy_inputs(plan: CampaignPlan, folders: Folders, store: ObjectStore, target: Path) -> None:
    """Copy a document's files into an empty folder.

    Raises:
        InputError: they are not what the plan says.
        StorageError: they cannot be fetched.
    """
    if plan.bundle is not None:
        _unpack(plan.bundle, store, folders, target)
    elif plan.git is not None:
        _checkout(plan.git, folders, target)
    elif folders.files.is_dir():
        _copy_mounted(folders.files, target)
    _refuse_links_out(target)


def _copy_mounted(source: Path, target: Path) -> None:
    """Copy mounted files without the links that such a volume is made of.

    They have no file modes: files that begin with `#!` become executable.
    """
    packed = source / PACKED
    for folder, subfolders, names in os.walk(source, followlinks=True):
        subfolders[:] = [name for name in subfolders if not name.startswith("..")]
        is_packed = Path(folder).is_relative_to(packed)
        there = target / Path(folder).relative_to(packed if is_packed else source)
        there.mkdir(parents=True, exist_ok=True)
        for name in names:
            if not name.startswith(".."):
                content = (Path(folder) / name).read_bytes()
                (there / name).write_bytes(unpack(content) if is_packed else content)
                _make_executable(there / name)


def _make_executable(path: Path) -> None:
    with path.open("rb") as file:
        if file.read(2) == b"#!":
            path.chmod(EXECUTABLE)


def _unpack(bundle: Bundle, store: ObjectStore, folders: Folders, target: Path) -> None:
    content = store.read(bundle.bucket, bundle.key)
    name = f"{bundle.bucket}/{bundle.key}"
    if content is None:
        raise InputError(
            f"the archive of the document's files, {name}, does not exist.",
            hint="correct spec.source.bundle, or upload the archive",
        )
    found = hashlib.sha256(content).hexdigest()
    if found != bundle.sha256:
        raise InputError(
            f"{name}: its SHA-256 is {found}; the campaign wants {bundle.sha256}.",
            hint="correct the SHA-256 in spec.source.bundle, or upload the archive again",
        )
    from robovast.campaign.archive import unpack as unpack_archive  # which few campaigns need

    archive = folders.scratch / "bundle"
    archive.parent.mkdir(parents=True, exist_ok=True)
    archive.write_bytes(content)
    try:
        unpack_archive(archive, target, expansion=inf)
    except InputError as error:
        message = f"{name}: cannot be unpacked: {error.message}"
        raise InputError(message, hint=error.hint) from error
    finally:
        archive.unlink()


def _checkout(git: GitSource, folders: Folders, target: Path) -> None:
    repository = folders.scratch / "repository"
    shutil.rmtree(repository, ignore_errors=True)
    repository.mkdir(parents=True)
    for arguments in (
        ("init", "--quiet"),
        (*_login(git.url, folders.git), "fetch", "--quiet", "--depth=1", "--", git.url, git.ref),
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
            raise StorageError(f"{git.url}: `{git.ref}` cannot be downloaded: {cause}")
    shutil.rmtree(repository / ".git")  # it holds the URL, with whatever stands in it
    folder = Path(os.path.normpath(repository / git.path))
    if _leads_out(folder, repository) or not folder.is_dir():
        raise InputError(
            f"{git.url}: `{git.ref}` has no folder `{git.path}`.", hint="correct spec.source.git"
        )
    _resolve_links(folder, repository)
    shutil.copytree(folder, target, dirs_exist_ok=True, symlinks=True)


def _login(url: str, folder: Path) -> list[str]:
    """Options by which git finds an account's name and password, for this server alone."""
    if not (folder / "password").is_file():
        return []
    parts = urlsplit(url)
    server = f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}"
    user, password = (shlex.quote(str(folder / name)) for name in ("username", "password"))
    script = f'printf "username=%s\\npassword=%s\\n" "$(cat {user})" "$(cat {password})"'
    return ["-c", "credential.helper=", "-c", f"credential.{server}.helper=!f() {{ {script}; }}; f"]


def _resolve_links(folder: Path, checkout: Path) -> None:
    """Put files in place of links to files elsewhere in a checkout.

    Raises:
        InputError: a link leads out of it, or to a folder elsewhere in it.
    """
    for link in _links(folder):
        if _leads_out(link, folder):
            target = Path(os.path.realpath(link))
            if _leads_out(link, checkout) or not target.is_file():
                raise _refused(link.relative_to(checkout))
            link.unlink()
            shutil.copy(target, link)


def _refuse_links_out(folder: Path) -> None:
    """Refuse links that lead out of the document's folder, such as to our credentials."""
    for link in _links(folder):
        if _leads_out(link, folder):
            raise _refused(link.relative_to(folder))


def _links(folder: Path) -> Iterator[Path]:
    for below, subfolders, names in os.walk(folder):
        paths = [Path(below, name) for name in (*subfolders, *names)]
        yield from filter(Path.is_symlink, paths)


def _leads_out(link: Path, folder: Path) -> bool:
    return not Path(os.path.realpath(link)).is_relative_to(os.path.realpath(folder))


def _refused(link: Path) -> InputError:
    return InputError(
        f"`{link}`, one of the document's files, is a link that leads out of them",
        hint="put the file itself there, or a relative link to another one of them",
    )

"""`share`: packs a campaign's results straight from the bucket, and uploads them to a share."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from robovast.agent.mounts import Folders
from robovast.base.backoff import BUSY, REPEATABLE
from robovast.base.errors import InputError
from robovast.base.sizes import fmt_size
from robovast.kubeapi.pod_contract.exit_codes import AgentExit
from robovast.kubeapi.pod_contract.messages import Shared
from robovast.storage.bucket_ownership import is_owned
from robovast.storage.compressing import pack_bucket
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.http_client import HttpError
from robovast.storage.s3 import ObjectStore
from robovast.storage.shares.campaigns import SHARE_TYPE, SUFFIX, Share, load_provider

PAUSE = 5.0
"""Shortest time between two progress lines [s]."""


@dataclass(frozen=True)
class ShareRequest:
    """Results that are stored."""

    campaign: str
    """Name of the results folder."""
    bucket: str
    endpoint: Endpoint
    uid: str | None = None
    """Of the Campaign that the bucket must be of."""


def share(folders: Folders, request: ShareRequest) -> AgentExit:
    """Upload a campaign as `<campaign>.tar.gz`, replacing one on the share.

    Access to the share is checked before anything is packed.

    Raises:
        InputError: the share refuses, or is not described as it must be.
        StorageError: the bucket, the share or the pod's disk cannot be read or written.
    """
    opened = _open(folders.share)
    archive = folders.work / f"{request.campaign}{SUFFIX}"
    with _final_refusals():
        opened.verify()
        print(f"The share `{opened.provider.SHARE_TYPE}` can be used.")  # noqa: T201
        _pack(folders, request, archive)
        opened.put(archive, UploadProgress("uploaded"))
    size = archive.stat().st_size
    archive.unlink()
    print(f"{archive.name} is on the share ({fmt_size(size)}).")  # noqa: T201
    Shared(archive=archive.name, size=size).write(folders.message)
    return AgentExit.PASSED


def _open(folder: Path) -> Share:
    """The share that a mounted Secret describes; its variables go into the environment.

    Files that are called as no variable can be are the provider's own.
    """
    paths = [path for path in folder.iterdir() if path.name.isidentifier() and path.is_file()]
    variables = {path.name: _text(path) for path in paths}
    if not variables:
        raise InputError(
            "the Secret that `spec.share` names is not in the campaign's namespace, or is empty",
            hint=f"create it with {SHARE_TYPE} and the settings of the file share",
        )
    if SHARE_TYPE not in variables:
        raise InputError(
            f"{folder}: the Secret that describes the share has no {SHARE_TYPE}.",
            hint=f"add {SHARE_TYPE} to the Secret",
        )
    os.environ.update(variables)
    return Share(load_provider(variables[SHARE_TYPE], folder))


def _text(path: Path) -> str:
    """The value of a variable.

    Raises:
        InputError: no variable can have it.
    """
    content = path.read_bytes()
    with suppress(UnicodeDecodeError):
        if b"\0" not in content:
            return content.decode()
    raise InputError(
        f"{path}: a value in the Secret of the file share is not text",
        hint="name a file of a provider differently from a variable, for example `key.p12`",
    )


def _pack(folders: Folders, request: ShareRequest, archive: Path) -> None:
    credentials = Credentials.from_folder(folders.credentials)
    store = ObjectStore(request.endpoint, credentials, patience=REPEATABLE)
    if request.uid is not None:
        is_owned(store, request.bucket, request.uid)
    progress = UploadProgress("packed")
    for warning in pack_bucket(store, request.bucket, request.campaign, archive, progress):
        print(warning)  # noqa: T201


@contextmanager
def _final_refusals() -> Iterator[None]:
    """Turn a permanent refusal into an InputError: the share or its description is wrong."""
    try:
        yield
    except HttpError as error:
        if error.status in BUSY:
            raise
        raise InputError(error.message, hint=error.hint) from error


class UploadProgress:
    """A progress callback that writes to the pod's log.

    Args:
        word: what has happened to the bytes that are done.
        clock: the time [s].
    """

    def __init__(self, word: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._word = word
        self._clock = clock
        self._told = clock()
        self._line = ""

    def __call__(self, done: int, total: int) -> None:
        """Report the bytes that are done, and the total."""
        now = self._clock()
        if done < total and now - self._told < PAUSE:
            return
        ratio = done / total if total else 1.0
        line = f"{self._word} {ratio:.0%} ({fmt_size(done)} of {fmt_size(total)})"
        if line != self._line:
            print(line)  # noqa: T201
        self._told, self._line = now, line

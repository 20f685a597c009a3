"""The base class of share providers."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import IO, ClassVar, NoReturn
from uuid import uuid4

from robovast.base.errors import CannotRunError, InputError

ProgressCallback = Callable[[int, int], None]
"""Called with the number of bytes done, and of all bytes."""

INSECURE_SSL = "ROBOVAST_INSECURE_SSL"
"""Variable that disables verification of certificates if it is `1` or `true`."""


class BaseShareProvider(ABC):
    """A place for archives.

    A provider reads its address and credentials from `os.environ`, to which the caller has added
    the variables of a `.env` file. Upload-only providers implement the abstract methods; the others
    then raise an error.
    """

    SHARE_TYPE: ClassVar[str] = ""
    """Value of `ROBOVAST_SHARE_TYPE` that selects it."""

    @abstractmethod
    def required_env_vars(self) -> dict[str, str]:
        """Required variables, each with an explanation."""

    @abstractmethod
    def build_pod_env(self) -> dict[str, str]:
        """Variables that it needs in a pod, where it is created with these only."""

    @abstractmethod
    def upload_archive(
        self,
        archive_path: str,
        object_name: str,
        progress_callback: ProgressCallback | None = None,
    ) -> None:
        """Upload an archive; it appears on the share when it is complete.

        Args:
            archive_path: a local file.
            object_name: its name on the share, `<campaign>.tar.gz`.
            progress_callback: called with the number of sent bytes, and of all bytes.

        Raises:
            Exception: the upload failed; use `RobovastError` for messages to the user.
        """

    def verify_access(self) -> None:  # noqa: B027 - a provider may have nothing to check
        """Check cheaply whether the share can be used as configured; raise if not.

        It is called on the user's machine, and again in the pod with the variables of
        `build_pod_env`. By default, nothing is checked.
        """

    def list_campaign_archives_with_size(self) -> list[tuple[str, int]]:
        """Names of the archives on the share, each with its size [byte]."""
        self._cannot("list its archives")

    def download_archive(
        self,
        object_name: str,
        dest: str,
        progress_callback: ProgressCallback | None = None,
        resume_offset: int = 0,
    ) -> None:
        """Download an archive.

        Args:
            object_name: its name on the share.
            dest: a local file.
            progress_callback: called with the number of bytes that are here, and of all bytes.
            resume_offset: number of bytes that the file has already; the rest is appended.
        """
        del object_name, dest, progress_callback, resume_offset
        self._cannot("download from it")

    def remove_archive(self, name: str) -> None:
        """Remove an archive from the share."""
        del name
        self._cannot("remove archives")

    def archive_exists_on_share(self, name: str) -> bool:
        """Whether an archive is on the share."""
        return any(name == known for known, _ in self.list_campaign_archives_with_size())

    def _cannot(self, what: str) -> NoReturn:
        raise CannotRunError(f"the share provider `{self.SHARE_TYPE}` cannot {what}.")


class UploadProgressReader:
    """A request body that reads a file and reports the progress.

    Args:
        stream: an open file.
        total: its size [byte].
        progress_callback: called with the number of read bytes, and of all bytes.
    """

    def __init__(
        self,
        stream: IO[bytes],
        total: int,
        progress_callback: ProgressCallback | None = None,
    ) -> None:
        self._stream = stream
        self._total = total
        self._callback = progress_callback

    def __len__(self) -> int:
        return self._total

    def read(self, size: int = -1) -> bytes:
        """The next bytes."""
        data = self._stream.read(size)
        if self._callback and data:
            self._callback(min(self._stream.tell(), self._total), self._total)
        return data

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Set the position, for example to the start for another attempt."""
        return self._stream.seek(offset, whence)

    def tell(self) -> int:
        """Current position."""
        return self._stream.tell()


def check_variables(provider: BaseShareProvider) -> None:
    """Check that all required variables of a provider are set.

    Raises:
        InputError: variables are missing; the message explains each.
    """
    required = provider.required_env_vars()
    missing = {name: text for name, text in required.items() if not os.environ.get(name)}
    if missing:
        lines = "".join(f"\n    {name}: {text}" for name, text in missing.items())
        raise InputError(
            f"the share `{provider.SHARE_TYPE}` needs variables that are not set:{lines}",
            hint="set them in the environment or a `.env` file",
        )


def probe_name() -> str:
    """Unique name of a temporary file for checking write access.

    Others may check the same share at the same time, and every pod has the same process id.
    """
    return f".robovast-access-{uuid4().hex}"


def accepts_any_certificate() -> bool:
    """Whether the user has disabled verification of certificates."""
    return os.environ.get(INSECURE_SSL, "").lower() in {"1", "true", "yes", "on"}

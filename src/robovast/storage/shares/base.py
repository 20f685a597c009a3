"""The base class of share providers."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import IO, ClassVar, NoReturn
from uuid import uuid4

from robovast.base.errors import CannotRunError, InputError

ProgressCallback = Callable[[int, int], None]
"""Is told how many bytes are done, of how many."""

INSECURE_SSL = "ROBOVAST_INSECURE_SSL"
"""Variable that, when it is set to `1` or `true`, accepts servers that prove nothing."""


class BaseShareProvider(ABC):
    """A place for archives.

    A provider takes its address and credentials from `os.environ`, where the caller has put what
    a `.env` file says. A subclass that can only upload implements the abstract methods; the others
    say that it cannot.
    """

    SHARE_TYPE: ClassVar[str] = ""
    """Value of `ROBOVAST_SHARE_TYPE` that chooses it."""

    @abstractmethod
    def required_env_vars(self) -> dict[str, str]:
        """Variables that must be set, each with an explanation."""

    @abstractmethod
    def build_pod_env(self) -> dict[str, str]:
        """Variables that it needs in a pod: it is made there with these alone."""

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
            progress_callback: is told how many bytes are sent, of how many.

        Raises:
            Exception: it could not be uploaded; `RobovastError` with a message for the user.
        """

    def verify_access(self) -> None:  # noqa: B027 - a provider may have nothing to check
        """Raise when the share cannot be used as configured; cheap.

        It is called on the user's machine, and again in the pod with the variables of
        `build_pod_env`. Without a subclass that asks the share, nothing is checked.
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
            progress_callback: is told how many bytes are here, of how many.
            resume_offset: how many bytes the file has already; the rest is appended.
        """
        del object_name, dest, progress_callback, resume_offset
        self._cannot("download from it")

    def remove_archive(self, name: str) -> None:
        """Remove an archive from the share."""
        del name
        self._cannot("remove archives")

    def archive_exists_on_share(self, name: str) -> bool:
        """True when an archive is on the share."""
        return any(name == known for known, _ in self.list_campaign_archives_with_size())

    def _cannot(self, what: str) -> NoReturn:
        raise CannotRunError(f"the share provider `{self.SHARE_TYPE}` cannot {what}.")


class UploadProgressReader:
    """Reads a file and tells how far it is; a request's body.

    Args:
        stream: an open file.
        total: its size [byte].
        progress_callback: is told how many bytes were read, of how many.
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
        """Go elsewhere in the file, as to its beginning for another attempt."""
        return self._stream.seek(offset, whence)

    def tell(self) -> int:
        """Where it is in the file."""
        return self._stream.tell()


def check_variables(provider: BaseShareProvider) -> None:
    """Raise when a variable that a provider needs is not set.

    Raises:
        InputError: with every such variable and what it is.
    """
    required = provider.required_env_vars()
    missing = {name: text for name, text in required.items() if not os.environ.get(name)}
    if missing:
        lines = "".join(f"\n    {name}: {text}" for name, text in missing.items())
        raise InputError(
            f"the share `{provider.SHARE_TYPE}` needs variables that are not set, in the "
            f"environment or a `.env` file:{lines}"
        )


def probe_name() -> str:
    """Name of a file that is written to see whether that is allowed; of this attempt alone.

    Others may try the same share at the same moment, and every pod has the same process id.
    """
    return f".robovast-access-{uuid4().hex}"


def accepts_any_certificate() -> bool:
    """True when the user has given up on knowing whom the share belongs to."""
    return os.environ.get(INSECURE_SSL, "").lower() in {"1", "true", "yes", "on"}

"""The address of an S3 server, and the credentials of an account."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from robovast.base.errors import StorageError

DEFAULT_REGION = "us-east-1"
"""Default region of servers other than Amazon's."""


@dataclass(frozen=True)
class Endpoint:
    """Address of an S3 server."""

    host: str
    """`HOST` or `HOST:PORT`."""
    secure: bool = True
    """Use TLS; CA certificates come from `$SSL_CERT_FILE`, else from certifi."""
    region: str = DEFAULT_REGION

    @classmethod
    def parse(cls, text: str, region: str | None = None) -> Endpoint:
        """Parse `https://host:port`, `http://host:port` or `host:port`, which means HTTPS.

        Args:
            text: the address.
            region: by default `us-east-1`.
        """
        scheme, _, host = text.rstrip("/").rpartition("://")
        return cls(host, scheme != "http", region or DEFAULT_REGION)

    def __str__(self) -> str:
        return f"{'https' if self.secure else 'http'}://{self.host}"


@dataclass(frozen=True)
class Credentials:
    """Keys of an account."""

    access_key: str
    secret_key: str = field(repr=False)

    @classmethod
    def from_folder(cls, folder: Path) -> Credentials:
        """Read the files `accessKey` and `secretKey` of a mounted Secret.

        Raises:
            StorageError: a file is missing or empty.
        """
        return cls(*(_read_key(folder / name) for name in ("accessKey", "secretKey")))


def _read_key(path: Path) -> str:
    try:
        value = path.read_text(encoding="utf-8").strip()
    except OSError as error:
        raise StorageError(
            f"{path}: cannot be read ({error.strerror})",
            hint="check that the Secret with the S3 credentials has the keys `accessKey` and "
            "`secretKey`",
        ) from None
    if not value:
        raise StorageError(f"{path}: is empty", hint="it must hold a key of the S3 account")
    return value

"""Shares on SFTP servers."""

from __future__ import annotations

import hashlib
import os
import posixpath
from collections.abc import Callable, Mapping
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import paramiko
from paramiko import PKey, SFTPClient, SFTPFile, SSHClient

from robovast.base.backoff import TRANSFERRING, Pauses
from robovast.base.errors import InputError, StorageError
from robovast.base.file_errors import read_text, writing
from robovast.base.sizes import whole_number
from robovast.storage.shares.base import (
    INSECURE_SSL,
    BaseShareProvider,
    ProgressCallback,
    accepts_any_certificate,
    probe_name,
)

T = TypeVar("T")

HOST = "ROBOVAST_SFTP_HOST"
PORT = "ROBOVAST_SFTP_PORT"
USER = "ROBOVAST_SFTP_USER"
PASSWORD = "ROBOVAST_SFTP_PASSWORD"  # noqa: S105 - the name of a variable
KEY_FILE = "ROBOVAST_SFTP_KEY_FILE"
KEY_PEM = "ROBOVAST_SFTP_KEY_PEM"
REMOTE_DIR = "ROBOVAST_SFTP_REMOTE_DIR"
HOST_KEY = "ROBOVAST_SFTP_HOST_KEY"
"""Public key of a server that is in no `known_hosts` file: `ssh-ed25519 AAAA…`."""

CHUNK = 2**18
"""Block size of transfers [byte]."""
REQUESTS = 64
"""Number of blocks that are requested ahead."""
ATTEMPTS = 20
"""Minimum number of retries of a transfer."""
TIMEOUT = 60.0
"""Timeout of a server without response [s]."""
SSH_PORT = 22

_KEY_TYPES: tuple[type[PKey], ...] = (
    paramiko.Ed25519Key,
    paramiko.ECDSAKey,
    paramiko.RSAKey,
)


class SftpShareProvider(BaseShareProvider):
    """A folder on an SSH server."""

    SHARE_TYPE: ClassVar[str] = "sftp"

    def required_env_vars(self) -> dict[str, str]:
        """Server and account; there are several ways of authentication."""
        return {HOST: "name of the server", USER: "name of the account"}

    def build_pod_env(self) -> dict[str, str]:
        """The variables, with keys in place of files that pods do not have."""
        names = (HOST, PORT, USER, PASSWORD, KEY_PEM, REMOTE_DIR, HOST_KEY, INSECURE_SSL)
        env = {name: os.environ[name] for name in names if name in os.environ}
        if KEY_FILE in os.environ and KEY_PEM not in env:
            env[KEY_PEM] = read_text(_key_file())
        known = _known_host_key()
        return {**env, **({HOST_KEY: known} if known else {})}

    def verify_access(self) -> None:
        """Write a small file and remove it."""
        probe = _remote(probe_name())

        def write(sftp: SFTPClient) -> None:
            with sftp.open(probe, "w"):
                pass
            sftp.remove(probe)

        _with_server(f"write to {_folder()}", write)

    def upload_archive(
        self,
        archive_path: str,
        object_name: str,
        progress_callback: ProgressCallback | None = None,
    ) -> None:
        """Upload an archive under a temporary name, resuming earlier attempts, then rename it."""
        path = Path(archive_path)
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        # The name contains a digest, so that only the same archive is resumed.
        part = _remote(f".{object_name}.{digest[:16]}.part")

        def upload(sftp: SFTPClient) -> None:
            _append(sftp, path, part, progress_callback)
            _replace(sftp, part, _remote(object_name))

        _with_server(f"upload {object_name}", upload)

    def list_campaign_archives_with_size(self) -> list[tuple[str, int]]:
        """Archives in the folder, not in folders below it."""
        found = _with_server(f"list {_folder()}", lambda sftp: sftp.listdir_attr(_folder()))
        return sorted(
            (item.filename, item.st_size or 0)
            for item in found
            if item.filename.endswith(".tar.gz") and not item.filename.startswith(".")
        )

    def download_archive(
        self,
        object_name: str,
        dest: str,
        progress_callback: ProgressCallback | None = None,
        resume_offset: int = 0,
    ) -> None:
        """Download an archive; after an interruption, only the rest is downloaded."""
        path = Path(dest)
        with writing(path), path.open("r+b" if resume_offset and path.exists() else "wb") as file:
            file.seek(resume_offset)
            file.truncate()

            def download(sftp: SFTPClient) -> None:
                with sftp.open(_remote(object_name), "rb") as source:
                    size = source.stat().st_size or 0
                    source.seek(file.tell())
                    _prefetch(source, size)
                    while data := source.read(CHUNK):
                        with writing(path):  # otherwise it would count as the server's error
                            file.write(data)
                        if progress_callback:
                            progress_callback(file.tell(), size)

            _with_server(f"download {object_name}", download)

    def remove_archive(self, name: str) -> None:
        """Remove an archive."""
        _with_server(f"remove {name}", lambda sftp: sftp.remove(_remote(name)))

    def archive_exists_on_share(self, name: str) -> bool:
        """Look for a single archive."""

        def exists(sftp: SFTPClient) -> bool:
            try:
                sftp.stat(_remote(name))
            except FileNotFoundError:
                return False
            return True

        return _with_server(f"look for {name}", exists)


def _append(sftp: SFTPClient, path: Path, part: str, progress: ProgressCallback | None) -> None:
    """Append the missing rest to a file on the server."""
    try:
        offset = sftp.stat(part).st_size or 0
    except FileNotFoundError:
        offset = 0
    total = path.stat().st_size
    with path.open("rb") as source, sftp.open(part, "ab" if offset else "wb") as target:
        target.set_pipelined(True)
        source.seek(offset)
        while data := source.read(CHUNK):
            target.write(data)
            if progress:
                progress(source.tell(), total)
    found = sftp.stat(part).st_size
    if found != total:
        sftp.remove(part)
        raise StorageError(
            f"{_place()}: of {path.name} {found} of {total} bytes arrived",
            hint="check the free space on the server",
        )


def _prefetch(source: SFTPFile, size: int) -> None:
    """Request blocks ahead of reading.

    The reader notices a lost connection; the requesting thread must not print it as well.
    """
    inner: Any = source
    ask = inner._prefetch_thread

    def ask_quietly(*arguments: Any) -> None:
        with suppress(paramiko.SSHException, EOFError, OSError):
            ask(*arguments)

    inner._prefetch_thread = ask_quietly
    source.prefetch(size, REQUESTS)


def _replace(sftp: SFTPClient, part: str, target: str) -> None:
    try:
        sftp.posix_rename(part, target)
    except OSError:  # older servers only rename to unused names
        with suppress(FileNotFoundError):
            sftp.remove(target)
        sftp.rename(part, target)


def _with_server(attempt: str, action: Callable[[SFTPClient], T]) -> T:
    """Execute an action on the server, again after a lost connection.

    Raises:
        InputError: the account or the server's key is not accepted, or a file is missing.
        StorageError: the server is unreachable or refuses.
    """
    pauses = Pauses(TRANSFERRING, ATTEMPTS)
    was_connected = False
    while True:
        client = SSHClient()
        try:
            _connect(client)
            was_connected = True
            with client.open_sftp() as sftp:
                channel = sftp.get_channel()
                if channel is not None:
                    channel.settimeout(TIMEOUT)
                return action(sftp)
        except (paramiko.SSHException, EOFError, OSError) as error:
            again = was_connected and _is_lost(client, error)
            if not again or not pauses.wait():
                raise _error_of(attempt, error) from error
        finally:
            client.close()


def _connect(client: SSHClient) -> None:
    client.load_system_host_keys()
    client.set_missing_host_key_policy(_Policy())
    explicit = any(os.environ.get(name) for name in (PASSWORD, KEY_FILE, KEY_PEM))
    client.connect(
        os.environ[HOST],
        _port(),
        os.environ[USER],
        os.environ.get(PASSWORD) or None,
        pkey=_private_key(),
        key_filename=str(_key_file()) if os.environ.get(KEY_FILE) else None,
        allow_agent=not explicit,
        look_for_keys=not explicit,
        timeout=TIMEOUT,
        banner_timeout=TIMEOUT,
        auth_timeout=TIMEOUT,
    )


def _is_lost(client: SSHClient, error: Exception) -> bool:
    transport = client.get_transport()
    gone = transport is None or not transport.is_active()
    refused = isinstance(error, paramiko.AuthenticationException | paramiko.BadHostKeyException)
    return not refused and (gone or isinstance(error, EOFError | TimeoutError))


class _Policy(paramiko.MissingHostKeyPolicy):
    """Accepts the server's key given by the user, or any key if the user allows that."""

    def missing_host_key(self, client: SSHClient, hostname: str, key: PKey) -> None:
        del client
        given = os.environ.get(HOST_KEY, "").split()
        found = f"{key.get_name()} {key.get_base64()}"
        if accepts_any_certificate() or given[:2] == found.split():
            return
        raise InputError(
            f"the server {hostname} is not known: its key ({key.fingerprint}) is\n    {found}",
            hint=f"if its administrator confirms this fingerprint, put the key into {HOST_KEY} "
            "or a `known_hosts` file",
        )


def _error_of(attempt: str, error: Exception) -> InputError | StorageError:
    start = f"{_place()}: cannot {attempt}"
    if isinstance(error, paramiko.BadHostKeyException):
        return InputError(
            f"{start}: the server's key is not the one in `known_hosts`, so the connection may be "
            "intercepted",
            hint="ask its administrator",
        )
    if isinstance(error, paramiko.AuthenticationException):
        return InputError(
            f"{start}: the server does not accept the account",
            hint=f"check {USER} and {PASSWORD}, {KEY_FILE} or {KEY_PEM}",
        )
    if isinstance(error, FileNotFoundError):
        return InputError(f"{start}: there is no such file or folder", hint=f"check {REMOTE_DIR}")
    if isinstance(error, PermissionError):
        return StorageError(
            f"{start}: the account is not allowed to do that.",
            hint="ask the administrator of the server for the permission",
        )
    cause = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return StorageError(
        f"{start} ({cause})", hint="check the address of the server, its free space and the network"
    )


def _known_host_key() -> str | None:
    """The server's key in the files of this machine."""
    path = Path("~/.ssh/known_hosts").expanduser()
    if not path.is_file():
        return None
    host, port = os.environ.get(HOST, ""), _port()
    name = host if port == SSH_PORT else f"[{host}]:{port}"
    known: Mapping[str, PKey] = paramiko.HostKeys(str(path)).lookup(name) or {}
    return next((f"{key.get_name()} {key.get_base64()}" for key in known.values()), None)


def _private_key() -> PKey | None:
    text = os.environ.get(KEY_PEM)
    if not text:
        return None
    for key_type in _KEY_TYPES:
        with suppress(paramiko.SSHException, ValueError):
            return key_type.from_private_key(StringIO(text.replace("\\n", "\n")))
    raise InputError(
        f"{KEY_PEM} contains no private key that can be read without a passphrase.",
        hint="use a key without a passphrase",
    )


def _key_file() -> Path:
    path = Path(os.environ[KEY_FILE]).expanduser()
    if not path.is_file():
        raise InputError(f"{KEY_FILE}: there is no file {path}.", hint=f"correct {KEY_FILE}")
    return path


def _port() -> int:
    text = os.environ.get(PORT) or "22"
    port = whole_number(text)
    if not 0 < port < 1 << 16:
        raise InputError(f"{PORT} is not a port: `{text}`", hint="set it to a number up to 65535")
    return port


def _place() -> str:
    return f"sftp://{os.environ[HOST]}"


def _folder() -> str:
    return os.environ.get(REMOTE_DIR) or "."


def _remote(name: str) -> str:
    return posixpath.join(_folder(), name)

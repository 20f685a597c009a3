"""`notify`: sends a notice about a campaign to a receiver outside of the cluster.

A notice is one POST request, to ntfy as well, so this needs no library but the HTTP client.
"""

from __future__ import annotations

import json
import os
from base64 import b64encode
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import SplitResult, quote, unquote, unquote_plus, urlsplit

from pydantic import ValidationError

from robovast.agent.mounts import Folders
from robovast.base.backoff import BUSY, REPEATABLE
from robovast.base.errors import InputError
from robovast.kubeapi.notice import NOTICE_VARIABLE, Event, Notice, Order
from robovast.kubeapi.pod_contract.exit_codes import AgentExit, PlanError
from robovast.kubeapi.resources import Notification, SecretKey
from robovast.kubeapi.secret_names import SECRET_PREFIX
from robovast.storage.http_client import HttpClient, HttpError

TIMEOUT = 20.0
"""How long a server may send nothing [s]."""

_SHORT_WORD = 12
"""Letters of a path segment that may be a secret nevertheless."""
_PRIORITIES: Mapping[Event, str] = {
    "GivenUp": "5",
    "Stalled": "4",
    "Started": "2",
    "Batch": "2",
    "Progress": "2",
}
"""Priorities of ntfy: 5 rings, 3 is usual, 2 makes no sound."""
_TAGS: Mapping[Event, str] = {
    "GivenUp": "rotating_light",
    "Stalled": "warning",
    "Started": "rocket",
    "Batch": "mag",
    "Progress": "hourglass_flowing_sand",
}
"""Tags of ntfy, which shows them as pictures."""


@dataclass(frozen=True)
class Address:
    """The address of a receiver."""

    url: str
    """The URL, without user name and password."""
    headers: Mapping[str, str]
    """Headers with the credentials."""
    secrets: tuple[str, ...]
    """Texts that must not appear in any message."""

    @property
    def server(self) -> str:
        """The server, as messages name it."""
        parts = urlsplit(self.url)
        return f"{parts.scheme}://{parts.netloc}"


def notify(folders: Folders, index: int) -> AgentExit:
    """Send a notice to one of its receivers.

    Args:
        folders: of the pod.
        index: which of the receivers.

    Raises:
        PlanError: there is no notice, or none of this version.
        InputError: the receiver's server refuses it, or is not described as it must be.
        StorageError: the server is busy, or cannot be reached: it may take it later.
    """
    order = _order()
    receiver, notice = order.receivers[index], order.notice
    address = _address(receiver, folders.receivers / str(index))
    headers, body = (_ntfy if receiver.kind == "ntfy" else _webhook)(notice, receiver)
    client = HttpClient(
        f"{receiver.kind} at {address.server}",
        address.headers,
        secrets=address.secrets,
        patience=REPEATABLE,
        timeout=TIMEOUT,
    )
    try:
        client.request(
            "POST",
            address.url,
            attempt=f"send the notification that {notice.title}",
            body=lambda: body,
            headers=headers,
        )
    except HttpError as error:
        if error.status in BUSY:
            raise
        raise InputError(error.message, hint=error.hint) from error
    print(f"Sent to {receiver.kind} at {address.server}: {notice.title}.")  # noqa: T201
    return AgentExit.PASSED


def _order() -> Order:
    try:
        return Order.model_validate_json(os.environ.get(NOTICE_VARIABLE, ""))
    except ValidationError as error:
        raise PlanError(
            f"${NOTICE_VARIABLE} is not a valid notification of this version: {error}",
            hint="operator and agent must have the same version. Check whether only one of them "
            "was updated",
        ) from None


def _address(receiver: Notification, folder: Path) -> Address:
    """The address of a receiver, with its Secrets."""
    given = receiver.url or _secret(folder / "url", receiver.url_from)
    token = _secret(folder / "token", receiver.token_from)
    try:
        parts = urlsplit(given)
        usable = parts.scheme in {"http", "https"} and parts.hostname and parts.port != 0
    except ValueError:
        usable = False
    if not usable:
        raise InputError(
            f"the URL of a notification target ({receiver.kind}) does not start with http:// or "
            "https://",
            hint="correct the URL in the Secret of the notification target",
        )
    user, password = unquote(parts.username or ""), unquote(parts.password or "")
    netloc = parts.netloc.rpartition("@")[2]
    login = b64encode(f"{user}:{password}".encode()).decode() if user or password else ""
    granted = f"Bearer {token}" if token else f"Basic {login}" if login else ""
    headers = {"Authorization": granted} if granted else {}
    secrets = (*_secret_parts(parts), user, password, login, token)
    return Address(parts._replace(netloc=netloc, fragment="").geturl(), headers, secrets)


def _secret_parts(parts: SplitResult) -> Iterator[str]:
    """Generate the parts of a URL that may be a secret, as they stand there and decoded.

    Each may be quoted alone in the answer of a server. Short words of the path, such as `api` and
    `hook`, are no secrets, and would be removed from other words.
    """
    values = [pair.partition("=")[2] for pair in parts.query.split("&")]
    path = (parts.path.strip("/"), *parts.path.split("/"))
    segments = [part for part in path if not (part.isalpha() and len(part) < _SHORT_WORD)]
    for part in (parts.path, parts.query, *segments, *values):
        yield from {part, unquote(part), unquote_plus(part), quote(part, safe="")}


def _secret(file: Path, named: SecretKey | None) -> str:
    """The text in a mounted Secret; empty when none is named."""
    if named is None:
        return ""
    try:
        text = file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError):
        text = ""
    if not (text and text.isascii() and text.isprintable()):
        raise InputError(
            f"spec.notifications needs the Secret `{named.name}` with one line of ASCII under the "
            f"key `{named.key}`. The Secret is missing, has no such line, or is not for campaigns",
            hint=f"create the Secret with a name that begins with `{SECRET_PREFIX}`",
        )
    return text


def _ntfy(notice: Notice, receiver: Notification) -> tuple[dict[str, str], bytes]:
    """A message as ntfy takes it."""
    failed = notice.event == "Finished" and notice.verdict == "Failed"
    headers = {
        "Title": notice.title,
        "Priority": "4" if failed else _PRIORITIES.get(notice.event, "3"),
        "Tags": "x" if failed else _TAGS.get(notice.event, "white_check_mark"),
        "X-Sequence-ID": notice.id,
        **({"Click": receiver.link} if receiver.link else {}),
    }
    return headers, notice.text.encode()


def _webhook(notice: Notice, receiver: Notification) -> tuple[dict[str, str], bytes]:
    """A message as JSON."""
    payload = {**notice.payload(), **({"link": receiver.link} if receiver.link else {})}
    headers = {"Content-Type": "application/json", "Idempotency-Key": notice.id}
    return headers, json.dumps(payload).encode()

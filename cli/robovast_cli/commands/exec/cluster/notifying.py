"""Notification targets of a campaign, from the environment or a `.env` file.

The variables go into a Secret that belongs to the campaign: who knows a topic can read it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any
from urllib.parse import urlsplit

from robovast.base.errors import InputError
from robovast.kubeapi.resources import SUBJECTS, Notification, SecretKey
from robovast_cli.commands.exec.cluster.secrets import create_secret, secret_name
from robovast_cli.kube.api import Json, Kubernetes
from robovast_cli.ui.output import say

TOPIC = "ROBOVAST_NTFY_TOPIC"
SERVER = "ROBOVAST_NTFY_SERVER"
TOKEN = "ROBOVAST_NTFY_TOKEN"  # noqa: S105 - the name of a variable
WEBHOOK = "ROBOVAST_WEBHOOK_URL"

PUBLIC_SERVER = "https://ntfy.sh"

_TOPIC = re.compile(r"[-_A-Za-z0-9]{1,64}")
_NTFY_URL, _NTFY_TOKEN, _WEBHOOK_URL = "ntfy-url", "ntfy-token", "webhook-url"


SUFFIX = "notify"
"""Suffix of the name of their Secret."""


def receivers(environment: Mapping[str, str]) -> dict[str, str]:
    """The variables as keys of a Secret; empty without receivers.

    Raises:
        InputError: the value of a variable is not a valid receiver.
    """
    found = {}
    topic, token = environment.get(TOPIC, ""), environment.get(TOKEN, "")
    if topic:
        server = environment.get(SERVER, "") or PUBLIC_SERVER
        if not _TOPIC.fullmatch(topic):
            hint = "use 1 to 64 letters, digits, `-` and `_`"
            raise InputError(f"{TOPIC}: this is not a valid name of a topic", hint=hint)
        _check_url(SERVER, server)
        found[_NTFY_URL] = f"{server.rstrip('/')}/{topic}"
        if token:
            found[_NTFY_TOKEN] = token
    webhook = environment.get(WEBHOOK, "")
    if webhook:
        _check_url(WEBHOOK, webhook)
        found[_WEBHOOK_URL] = webhook
    return found


def with_notifications(campaign: Json, values: Mapping[str, str]) -> Json:
    """Add the receivers to a Campaign, with a Secret that is created after it."""
    secret = secret_name(campaign, SUFFIX)

    def key(name: str) -> SecretKey | None:
        return SecretKey(name=secret, key=name) if name in values else None

    found = []
    if _NTFY_URL in values:
        url, token = key(_NTFY_URL), key(_NTFY_TOKEN)
        found.append(
            Notification(kind="ntfy", url_from=url, token_from=token, subjects=[*SUBJECTS])
        )
    if _WEBHOOK_URL in values:
        webhook = key(_WEBHOOK_URL)
        found.append(Notification(kind="webhook", url_from=webhook, subjects=[*SUBJECTS]))
    if not found:
        return campaign
    written = [item.model_dump(by_alias=True, exclude_defaults=True) for item in found]
    return {**campaign, "spec": {**campaign["spec"], "notifications": written}}


def begin(kube: Kubernetes, campaign: Mapping[str, Any], values: Mapping[str, str]) -> None:
    """Create the Secret of a Campaign that has receivers."""
    without = "No notifications will be sent"
    if values and create_secret(kube, campaign, SUFFIX, values, without):
        kinds = ("ntfy",) * (_NTFY_URL in values) + ("webhook",) * (_WEBHOOK_URL in values)
        say(f"Notifications by {' and '.join(kinds)}: start, each hour, end and problems.")


def _check_url(variable: str, url: str) -> None:
    try:
        parts = urlsplit(url)
        usable = parts.scheme in {"http", "https"} and bool(parts.hostname)
    except ValueError:
        usable = False
    if not usable or not (url.isascii() and url.isprintable()):
        raise InputError(
            f"{variable} is not a valid URL", hint="use a URL with http:// or https://"
        )

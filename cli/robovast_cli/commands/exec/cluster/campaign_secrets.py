"""Secrets of a campaign: its notification targets and its file share, from the environment.

A Secret belongs to its Campaign, because everyone who knows an ntfy topic can read it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from robovast.base.errors import InputError, RobovastError
from robovast.kubeapi.resources import API_VERSION, SUBJECTS, Notification, SecretKey
from robovast.kubeapi.secret_names import SECRET_PREFIX
from robovast.kubeapi.share_job import share_variables
from robovast.storage.shares.campaigns import SHARE_TYPE, open_share
from robovast_cli.kube.api import Json, KubernetesClient
from robovast_cli.ui.output import echo

TOPIC = "ROBOVAST_NTFY_TOPIC"
SERVER = "ROBOVAST_NTFY_SERVER"
TOKEN = "ROBOVAST_NTFY_TOKEN"  # noqa: S105 - the name of a variable
WEBHOOK = "ROBOVAST_WEBHOOK_URL"

PUBLIC_SERVER = "https://ntfy.sh"

_TOPIC = re.compile(r"[-_A-Za-z0-9]{1,64}")
_NTFY_URL, _NTFY_TOKEN, _WEBHOOK_URL = "ntfy-url", "ntfy-token", "webhook-url"
_NOTIFY, _SHARE = "notify", "share"
"""Suffixes of the names of the Secrets."""


@dataclass(frozen=True)
class CampaignSecrets:
    """Contents of the Secrets of a campaign; empty without notifications or file share."""

    notify: Mapping[str, str]
    share: Mapping[str, str]

    def add_to(self, campaign: Json) -> Json:
        """Return a Campaign that refers to its Secrets, which are created after it."""
        spec = dict(campaign["spec"])
        if self.notify:
            spec["notifications"] = self._notifications(_secret_name(campaign, _NOTIFY))
        if self.share:
            spec["share"] = {"secretName": _secret_name(campaign, _SHARE)}
        return {**campaign, "spec": spec}

    def create(self, kube: KubernetesClient, campaign: Mapping[str, Any]) -> None:
        """Create the Secrets of a Campaign; print an error, because the campaign runs anyway."""
        if self.notify and _create_secret(
            kube, campaign, _NOTIFY, self.notify, "No notifications will be sent"
        ):
            kinds = [kind for kind in ("ntfy", "webhook") if f"{kind}-url" in self.notify]
            echo(f"Notifications by {' and '.join(kinds)}: start, each hour, end and problems.")
        without = "The results will not be uploaded to the file share"
        if self.share and _create_secret(kube, campaign, _SHARE, self.share, without):
            kind = self.share[SHARE_TYPE]
            echo(f"Its results are uploaded to the file share `{kind}` at the end.")

    def _notifications(self, secret: str) -> list[Json]:
        def key(name: str) -> SecretKey | None:
            return SecretKey(name=secret, key=name) if name in self.notify else None

        found = []
        if url := key(_NTFY_URL):
            token = key(_NTFY_TOKEN)
            found.append(
                Notification(kind="ntfy", url_from=url, token_from=token, subjects=[*SUBJECTS])
            )
        if url := key(_WEBHOOK_URL):
            found.append(Notification(kind="webhook", url_from=url, subjects=[*SUBJECTS]))
        return [item.model_dump(by_alias=True, exclude_defaults=True) for item in found]


def read_secrets(environment: Mapping[str, str]) -> CampaignSecrets:
    """Read notification targets and file share from variables.

    Raises:
        RobovastError: a value is invalid, or the file share rejects the upload that follows.
    """
    return CampaignSecrets(_read_targets(environment), _read_share(environment))


def _read_targets(environment: Mapping[str, str]) -> dict[str, str]:
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


def _read_share(environment: Mapping[str, str]) -> dict[str, str]:
    kind = environment.get(SHARE_TYPE)
    if not kind:
        return {}
    with open_share() as share:
        share.verify()
        return share_variables(kind, share.provider, Path.cwd())


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


def _secret_name(campaign: Mapping[str, Any], suffix: str) -> str:
    return f"{SECRET_PREFIX}{campaign['metadata']['name']}-{suffix}"


def _create_secret(
    kube: KubernetesClient,
    campaign: Mapping[str, Any],
    suffix: str,
    values: Mapping[str, str],
    without: str,
) -> bool:
    """Create a Secret that is deleted with its Campaign; print an error after `without`.

    Returns:
        Whether the Secret was created.
    """
    owner: dict[str, Any] = {
        "apiVersion": API_VERSION,
        "kind": "Campaign",
        "name": campaign["metadata"]["name"],
        "uid": campaign["metadata"]["uid"],
    }
    secret = {
        "apiVersion": "v1",
        "kind": "Secret",
        "metadata": {"name": _secret_name(campaign, suffix), "ownerReferences": [owner]},
        "immutable": True,
        "stringData": dict(values),
    }
    try:
        kube.create_secret(secret)
    except RobovastError as error:
        echo(f"{without}: {error}")
        return False
    return True

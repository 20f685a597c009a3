"""Secrets of one campaign, made of the user's environment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robovast.base.errors import RobovastError
from robovast.kubeapi.resources import API_VERSION
from robovast.kubeapi.secret_names import SECRET_PREFIX
from robovast_cli.kube.api import Json, Kubernetes
from robovast_cli.ui.output import say


def secret_name(campaign: Mapping[str, Any], suffix: str) -> str:
    """The name of a campaign's Secret for one purpose."""
    return f"{SECRET_PREFIX}{campaign['metadata']['name']}-{suffix}"


def create_secret(
    kube: Kubernetes,
    campaign: Mapping[str, Any],
    suffix: str,
    values: Mapping[str, str],
    without: str,
) -> bool:
    """Create a Secret that goes when its Campaign does.

    Args:
        kube: the cluster.
        campaign: its owner.
        suffix: end of its name.
        values: what it has.
        without: what is to be said if it cannot be made: that stops no campaign.

    Returns:
        Whether it was made.
    """
    try:
        kube.create_secret(_secret(campaign, suffix, values))
    except RobovastError as error:
        say(f"{without}: {error}")
        return False
    return True


def _secret(campaign: Mapping[str, Any], suffix: str, values: Mapping[str, str]) -> Json:
    owner: dict[str, Any] = {
        "apiVersion": API_VERSION,
        "kind": "Campaign",
        "name": campaign["metadata"]["name"],
        "uid": campaign["metadata"]["uid"],
    }
    return {
        "apiVersion": "v1",
        "kind": "Secret",
        "metadata": {"name": secret_name(campaign, suffix), "ownerReferences": [owner]},
        "immutable": True,
        "stringData": dict(values),
    }

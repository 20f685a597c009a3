"""The share that a campaign's results go to when they are complete, from the environment."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robovast.kubeapi.share_job import share_variables
from robovast.storage.shares.campaigns import SHARE_TYPE, open_share
from robovast_cli.commands.exec.cluster.secrets import create_secret, secret_name
from robovast_cli.kube.api import Json, Kubernetes
from robovast_cli.ui.output import say

SUFFIX = "share"
"""Suffix of the name of its Secret."""


def share_of(environment: Mapping[str, str]) -> dict[str, str]:
    """The variables of the share that is configured, as keys of a Secret; empty without one.

    Raises:
        RobovastError: variables are missing, or the share refuses: better now than at the end.
    """
    kind = environment.get(SHARE_TYPE)
    if not kind:
        return {}
    with open_share() as share:
        share.verify()
        return share_variables(kind, share.provider, Path.cwd())


def begin(kube: Kubernetes, campaign: Mapping[str, Any], variables: Mapping[str, str]) -> None:
    """Create the Secret of a Campaign whose results go to a share."""
    without = "The results will not be uploaded to the file share"
    if variables and create_secret(kube, campaign, SUFFIX, variables, without):
        say(f"Its results are uploaded to the file share `{variables[SHARE_TYPE]}` at the end.")


def with_share(campaign: Json, variables: Mapping[str, str]) -> Json:
    """Add the share to a Campaign, with a Secret that is created after it."""
    if not variables:
        return campaign
    share = {"secretName": secret_name(campaign, SUFFIX)}
    return {**campaign, "spec": {**campaign["spec"], "share": share}}

"""Looks for what runs need beside nodes, before any plan: volumes of assets, devices."""

from __future__ import annotations

from collections.abc import Sequence

from robovast.kubeapi.resources import ASSETS_LABEL
from robovast.model.document.assets import Assets
from robovast.model.document.gpus import NOT_COUNTED, REMEDY, asks_in_vain
from robovast_operator.kube import paths
from robovast_operator.kube.api import Api, ApiError
from robovast_operator.kube.lenient import mapping, mappings, metadata, text
from robovast_operator.kube.objects import Identity, Object
from robovast_operator.planning.campaign import Accepted, Rejected
from robovast_operator.pods.templates import asset_volumes

MISSING = frozenset(
    {
        *("AssetsNotFound", "AssetsNotAllowed", "AssetsNotSupported"),
        *("DevicesNotFound", "DevicesNotSupported"),
    }
)
"""Reasons of these rejections; no watch reports when they end."""


class Needs:
    """Looks for what the document of a campaign needs in its namespace."""

    def __init__(self, api: Api) -> None:
        self._api = api

    async def missing(self, accepted: Accepted) -> Rejected | None:
        """The rejection of a campaign that lacks something; None if all of it is there."""
        if asks_in_vain(accepted.vast.execution):
            message = f"execution.kubernetes.gpu_resource: {NOT_COUNTED}. {REMEDY}"
            return Rejected("InvalidDocument", message)
        assets = accepted.vast.execution.kubernetes.assets
        for one in assets:
            if one.claim is not None:
                refused = await self._claim(accepted.identity.namespace, one.claim)
                if refused is not None:
                    return refused
        images = [one for one in assets if one.image is not None]
        refused = await self._images(accepted.identity, images) if images else None
        templates = accepted.vast.execution.kubernetes.device_claims
        if refused is None and templates:
            return await self._devices(accepted.identity.namespace, templates)
        return refused

    async def _claim(self, namespace: str, name: str) -> Rejected | None:
        """Look for a claim, and for the mark of its owner that campaigns may read it."""
        claim = await self._find(f"{paths.volume_claims(namespace)}/{name}")
        if claim is None:
            return Rejected(
                "AssetsNotFound",
                f"execution.kubernetes.assets: the namespace {namespace} has no "
                f"PersistentVolumeClaim `{name}` (`kubectl get pvc -n {namespace}`)",
            )
        if mapping(metadata(claim).get("labels")).get(ASSETS_LABEL) == "true":
            return None
        return Rejected(
            "AssetsNotAllowed",
            f"execution.kubernetes.assets: campaigns may not read the claim `{name}`. Who looks "
            f"after it allows that: `kubectl label pvc -n {namespace} {name} {ASSETS_LABEL}=true`",
        )

    async def _devices(self, namespace: str, templates: Sequence[str]) -> Rejected | None:
        """Look for the templates of claims; a server that does not know them leaves them out."""
        served = await self._find(paths.group(paths.DEVICES))
        if served is None:
            return Rejected(
                "DevicesNotSupported",
                "execution.kubernetes.device_claims: this cluster has no dynamic resource "
                "allocation (Kubernetes has it by default from 1.34 on). Ask for `gpu` instead",
            )
        version = text(mapping(served.get("preferredVersion")).get("version"))
        for name in templates:
            if await self._find(paths.claim_template(version, namespace, name)) is None:
                return Rejected(
                    "DevicesNotFound",
                    f"execution.kubernetes.device_claims: the namespace {namespace} has no "
                    f"ResourceClaimTemplate `{name}` "
                    f"(`kubectl get resourceclaimtemplates -n {namespace}`)",
                )
        return None

    async def _find(self, path: str) -> Object | None:
        try:
            return await self._api.get(path)
        except ApiError as error:
            if error.code == 404:
                return None
            raise

    async def _images(self, identity: Identity, assets: list[Assets]) -> Rejected | None:
        """Let the server look at a Job with such volumes: one that does not know them drops them.

        What else it says against that Job is told of real ones.
        """
        path = paths.jobs(identity.namespace)
        try:
            made = await self._api.create(path, _trial(identity, assets), dry_run=True)
        except ApiError as error:
            if error.code == 0 or error.code >= 500:
                raise
            return None
        pod = mapping(mapping(mapping(mapping(made).get("spec")).get("template")).get("spec"))
        if made is None or len(list(mappings(pod.get("volumes")))) == len(assets):
            return None
        return Rejected(
            "AssetsNotSupported",
            "execution.kubernetes.assets: this cluster has no image volumes (Kubernetes has them "
            "by default from 1.35 on, before by the feature gate ImageVolume). Put the files into "
            "a claim instead",
        )


def _trial(identity: Identity, assets: list[Assets]) -> Object:
    """A Job that is never made."""
    pod = {
        "restartPolicy": "Never",
        "containers": [{"name": "trial", "image": "trial"}],
        "volumes": asset_volumes(assets),
    }
    return {
        "apiVersion": "batch/v1",
        "kind": "Job",
        "metadata": {"generateName": f"{identity.child('trial')}-"},
        "spec": {"template": {"spec": pod}},
    }

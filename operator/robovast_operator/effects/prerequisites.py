"""Look for what runs need in addition to nodes, before any plan: asset volumes, devices."""

from __future__ import annotations

from collections.abc import Sequence

from robovast.kubeapi.resources import ASSETS_LABEL
from robovast.model.document.assets import Assets
from robovast.model.document.gpus import NO_GPU, REMEDY, asks_in_vain
from robovast_operator.kube import paths
from robovast_operator.kube.api import Api, ApiError
from robovast_operator.kube.objects import Identity, Object
from robovast_operator.kube.untrusted_fields import mapping, mappings, metadata, text
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
        """Return the rejection of a campaign whose needs are not met; None if all needs are met."""
        if asks_in_vain(accepted.vast.execution):
            message = (
                f"The .vast file sets execution.kubernetes.gpu_resource, but {NO_GPU}. {REMEDY}"
            )
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
        """Look for a PersistentVolumeClaim, and for the label that lets campaigns read."""
        claim = await self._find(f"{paths.volume_claims(namespace)}/{name}")
        if claim is None:
            return Rejected(
                "AssetsNotFound",
                f"Namespace {namespace} has no PersistentVolumeClaim `{name}`. Set "
                "execution.kubernetes.assets to an existing PersistentVolumeClaim (`kubectl get "
                f"pvc -n {namespace}`).",
            )
        if mapping(metadata(claim).get("labels")).get(ASSETS_LABEL) == "true":
            return None
        return Rejected(
            "AssetsNotAllowed",
            f"Campaigns may not read the PersistentVolumeClaim `{name}` of "
            "execution.kubernetes.assets. Ask the owner of the PersistentVolumeClaim to run "
            f"`kubectl label pvc -n {namespace} {name} {ASSETS_LABEL}=true`.",
        )

    async def _devices(self, namespace: str, templates: Sequence[str]) -> Rejected | None:
        """Look for the templates of claims; a server that does not know them leaves them out."""
        served = await self._find(paths.group(paths.DEVICES))
        if served is None:
            return Rejected(
                "DevicesNotSupported",
                "The cluster does not support execution.kubernetes.device_claims, because dynamic "
                "resource allocation is missing (default in Kubernetes 1.34 and newer). Use `gpu` "
                "instead.",
            )
        version = text(mapping(served.get("preferredVersion")).get("version"))
        for name in templates:
            if await self._find(paths.claim_template(version, namespace, name)) is None:
                return Rejected(
                    "DevicesNotFound",
                    f"Namespace {namespace} has no ResourceClaimTemplate `{name}`. Set "
                    "execution.kubernetes.device_claims to an existing ResourceClaimTemplate "
                    f"(`kubectl get resourceclaimtemplates -n {namespace}`).",
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
        """Create a Job with image volumes as a dry run: a server without such volumes drops them.

        Other rejections of the Job are reported for real Jobs.
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
            "The cluster does not support images in execution.kubernetes.assets, because image "
            "volumes are missing (default in Kubernetes 1.35 and newer, or with the feature gate "
            "ImageVolume). Use a PersistentVolumeClaim instead.",
        )


def _trial(identity: Identity, assets: list[Assets]) -> Object:
    """Return a Job for a dry run."""
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

"""`BaseConfig`: the properties of a kind of cluster."""

from __future__ import annotations

import os
import tarfile
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

from robovast.base.errors import CannotRunError, InputError
from robovast.kubeapi.cluster_config.capacity import free_capacity

Option = tuple[str, str]
"""Default and explanation of an option."""

COMMON_OPTIONS: Mapping[str, Option] = {
    "storage_size": ("10Gi", "size of the volume of the embedded S3 server"),
    "storage_class": ("", "its StorageClass; the cluster's default when empty"),
    "s3_endpoint": ("", "URL of an S3 server of your own, in place of the embedded one"),
    "s3_region": ("", "its region"),
    "s3_secret": (
        "",
        "Secret of the namespace with `accessKey` and `secretKey` (default: created from "
        "$ROBOVAST_S3_ACCESS_KEY and $ROBOVAST_S3_SECRET_KEY)",
    ),
    "kueue": ("auto", "share the cluster by a Kueue queue: true, false, or when Kueue is there"),
}
"""Options of every kind of cluster that comes with RoboVAST."""


class BaseConfig:
    """A kind of cluster.

    `vast exec cluster setup NAME -o KEY=VALUE` calls `restore_from_setup_kwargs`, then
    `setup_cluster`, installs RoboVAST's chart with `chart_values`, and ends with
    `verify_cluster_ready`. A subclass overrides what differs on its clusters; every method has a
    default.
    """

    OPTIONS: ClassVar[Mapping[str, Option] | None] = None
    """Options by name; None takes any."""
    NOTES: ClassVar[str] = ""
    """Notes for whoever sets it up, in Markdown."""

    @cached_property
    def options(self) -> dict[str, str]:
        """Values of the options, the defaults included."""
        return {name: default for name, (default, _) in (self.OPTIONS or COMMON_OPTIONS).items()}

    def restore_from_setup_kwargs(self, kwargs: Mapping[str, Any]) -> None:
        """Take the options of a setup, before any other method is called.

        Args:
            kwargs: options by name.

        Raises:
            InputError: an option is unknown.
        """
        unknown = sorted(kwargs.keys() - (self.OPTIONS or kwargs).keys())
        if unknown:
            known = "; ".join(
                f"{name}: {text}" + (f" (default {default})" if default else "")
                for name, (default, text) in (self.OPTIONS or {}).items()
            )
            raise InputError(f"there is no option `{unknown[0]}` here", hint=f"use one of {known}")
        self.options.update({name: str(value) for name, value in kwargs.items()})

    def setup_cluster(self, **kwargs: Any) -> None:
        """Prepare the cluster before the chart is installed.

        Args:
            kwargs: `namespace`, `kube_context`, and the options of the setup.
        """

    def cleanup_cluster(self, **kwargs: Any) -> None:
        """Undo `setup_cluster`, after the chart was removed.

        Args:
            kwargs: `namespace`, `kube_context`.
        """

    def prepare_setup_cluster(self, output_dir: str, **kwargs: Any) -> None:
        """Write files and instructions for what `setup_cluster` does.

        Args:
            output_dir: existing folder.
            kwargs: `namespace`, and the options of the setup.
        """

    def verify_cluster_ready(
        self, k8s_client: Any = None, namespace: str = "default", kube_context: str | None = None
    ) -> None:
        """Raise an error if the setup is not ready; Helm has waited for the chart's pods."""

    def uses_embedded_s3(self) -> bool:
        """Whether the chart brings the S3 server."""
        return not self.options.get("s3_endpoint")

    def get_s3_endpoint(self) -> str:
        """URL of the S3 server as pods reach it; empty for the chart's own."""
        return self.options.get("s3_endpoint", "")

    def get_host_s3_endpoint(self) -> str:
        """URL of the S3 server as this machine reaches it; empty when it does not."""
        return os.environ.get("ROBOVAST_S3_ENDPOINT") or self.get_s3_endpoint()

    def get_s3_credentials(self) -> tuple[str, str]:
        """Access key and secret key; empty when the chart makes them."""
        names = ("ROBOVAST_S3_ACCESS_KEY", "ROBOVAST_S3_SECRET_KEY")
        access, secret = (os.environ.get(name, "") for name in names)
        return access, secret

    def get_s3_bucket(self) -> str:
        """The only bucket to use; empty: each campaign has its own."""
        return ""

    def get_s3_region(self) -> str:
        """Region of the S3 server; empty where there are none."""
        return self.options.get("s3_region", "")

    def get_storage_backend(self) -> str:
        """How results are stored."""
        return "s3"

    def get_instance_type_command(self) -> str:
        """Shell command that prints the type of machine that a pod is on; empty without."""
        return ""

    def get_cluster_allocatable_resources(
        self, kube_context: str | None = None
    ) -> tuple[float, int]:
        """CPUs [cores] and memory [byte] that campaigns may use together.

        By default what the nodes have beside what the pods on them ask for.

        Raises:
            CannotRunError: kubectl is missing, or cannot list nodes and pods.
        """
        return free_capacity(kube_context)

    def compress_campaign(self, campaign_id: str, archive_dir: str) -> str:
        """Fetch a campaign and write `<campaign>.tar.gz`.

        Args:
            campaign_id: name of the results folder; of the bucket where several have that name.
            archive_dir: existing folder.

        Returns:
            Path of the archive.

        Raises:
            CannotRunError: this machine does not reach the S3 server.
            InputError: there is no such campaign, or there are several.
            StorageError: it refuses, or the archive cannot be written.
        """
        from robovast.storage.bucket_ownership import find_bucket
        from robovast.storage.download import Silent, download_campaign
        from robovast.storage.endpoint import Credentials, Endpoint
        from robovast.storage.s3 import ObjectStore

        address = self.get_host_s3_endpoint()
        if not address:
            raise CannotRunError(
                "this machine does not reach the S3 server", hint="set $ROBOVAST_S3_ENDPOINT"
            )
        endpoint = Endpoint.parse(address, self.get_s3_region())
        store = ObjectStore(endpoint, Credentials(*self.get_s3_credentials()))
        found = find_bucket(store, campaign_id)
        if found is None:
            raise InputError(
                f"{address} has no results of a campaign `{campaign_id}`.",
                hint="check the name and the namespace of the campaign",
            )
        bucket, owner = found
        name = owner.campaign if owner is not None else campaign_id
        archive = Path(archive_dir) / f"{name}.tar.gz"
        with TemporaryDirectory(prefix="robovast-") as scratch:
            folder = Path(scratch) / name
            download_campaign(store, bucket, folder, Silent())
            with tarfile.open(archive, "w:gz") as file:
                file.add(folder, name)
        return str(archive)

    def chart_values(self) -> dict[str, Any]:
        """Values of the chart: the storage, without credentials."""
        if self.uses_embedded_s3():
            size, name = self.options.get("storage_size"), self.options.get("storage_class")
            embedded = {"enabled": True} | _given(size=size, storageClassName=name)
            return {"storage": {"embedded": embedded}}
        external = _given(endpoint=self.get_s3_endpoint(), region=self.get_s3_region())
        storage: dict[str, Any] = {"embedded": {"enabled": False}, "external": external}
        if self.options.get("s3_secret"):
            storage["credentials"] = {"existingSecret": self.options["s3_secret"]}
        return {"storage": storage}


def _given(**values: str | None) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value}

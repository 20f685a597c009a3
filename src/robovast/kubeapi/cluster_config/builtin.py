"""The kinds of clusters that RoboVAST knows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from robovast.base.errors import InputError
from robovast.kubeapi.cluster_config.base import COMMON_OPTIONS, BaseConfig, Option


class GenericConfig(BaseConfig):
    """Any cluster: its default StorageClass, or an S3 server of your own."""

    OPTIONS = COMMON_OPTIONS
    NOTES = """\
The embedded S3 server needs a StorageClass; `kubectl get storageclass` shows which is the default.
With `-o s3_endpoint=https://…` results go to a server of your own, and nothing needs a volume.
"""


class MinikubeConfig(GenericConfig):
    """minikube on this machine, for development."""

    OPTIONS: ClassVar[Mapping[str, Option]] = {
        **COMMON_OPTIONS,
        "storage_class": ("standard", "StorageClass of the embedded S3 server"),
    }
    NOTES = """\
Start it with `minikube start`. A local image gets into it with `minikube image load IMAGE`.
"""


class Rke2Config(GenericConfig):
    """RKE2 on machines of your own."""

    NOTES = """\
The kubeconfig of a server is `/etc/rancher/rke2/rke2.yaml`.
RKE2 comes without a StorageClass: install one, such as Longhorn or local-path, and name it with
`-o storage_class=NAME` when it is not the default; or use an S3 server of your own.
"""


class _DiskConfig(GenericConfig):
    """A cloud whose disks have types, each with a StorageClass."""

    DISKS: ClassVar[Mapping[str, str]]
    """StorageClass by type of disk; the first is the default."""

    def chart_values(self) -> dict[str, Any]:
        """Values of the chart, with the StorageClass of the type of disk."""
        disk = self.options["disk_type"]
        if disk not in self.DISKS:
            raise InputError(
                f"disk_type: `{disk}` is not a valid type of disk",
                hint=f"use one of {', '.join(self.DISKS)}",
            )
        self.options["storage_class"] = self.options["storage_class"] or self.DISKS[disk]
        return super().chart_values()


class GcpConfig(_DiskConfig):
    """Google Kubernetes Engine."""

    DISKS: ClassVar[Mapping[str, str]] = {
        "pd-standard": "standard",
        "pd-balanced": "standard-rwo",
        "pd-ssd": "premium-rwo",
    }
    OPTIONS: ClassVar[Mapping[str, Option]] = {
        **COMMON_OPTIONS,
        "disk_type": ("pd-standard", "persistent disk: pd-standard, pd-balanced or pd-ssd"),
    }
    NOTES = """\
Log in with `gcloud container clusters get-credentials CLUSTER --region REGION`; kubectl needs the
package `google-cloud-cli-gke-gcloud-auth-plugin`.
`kubectl config rename-context OLD gcp` gives the context a short name, which you can use in
the resources of a .vast file.
After a cleanup, look for leftover disks in the console.
"""

    def get_instance_type_command(self) -> str:
        """Ask Google's metadata server."""
        return (
            "curl --silent --header 'Metadata-Flavor: Google' "
            "http://metadata.google.internal/computeMetadata/v1/instance/machine-type "
            "| sed 's|.*/||'"
        )


class AzureConfig(_DiskConfig):
    """Azure Kubernetes Service."""

    DISKS: ClassVar[Mapping[str, str]] = {
        "standard": "managed-csi",
        "premium": "managed-csi-premium",
    }
    OPTIONS: ClassVar[Mapping[str, Option]] = {
        **COMMON_OPTIONS,
        "disk_type": ("standard", "managed disk: standard or premium"),
    }
    NOTES = """\
Log in with `az aks get-credentials --resource-group GROUP --name CLUSTER`.
After a cleanup look for disks that are left over in the node resource group.
"""

    def get_instance_type_command(self) -> str:
        """Ask Azure's metadata server."""
        return (
            "curl --silent --header 'Metadata: true' 'http://169.254.169.254/metadata/instance/"
            "compute/vmSize?api-version=2021-02-01&format=text'"
        )

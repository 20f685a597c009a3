"""Kubernetes objects, and the identity of a Campaign."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from robovast.kubeapi.names import child_name
from robovast.kubeapi.resources import (
    API_VERSION,
    CAMPAIGN_LABEL,
    MANAGED_BY,
    MANAGED_LABEL,
    UID_LABEL,
)

Object = dict[str, Any]
"""A Kubernetes object as JSON has it."""


Key = tuple[str, str]
"""Namespace and name of a Campaign."""


@dataclass(frozen=True)
class Identity:
    """The identity of a Campaign."""

    namespace: str
    name: str
    uid: str
    created: str
    """ISO 8601, UTC."""

    @classmethod
    def of(cls, obj: Object) -> Identity:
        """Return the identity of a Campaign object."""
        meta = obj["metadata"]
        return cls(meta["namespace"], meta["name"], meta["uid"], meta["creationTimestamp"])

    @property
    def key(self) -> Key:
        """Return namespace and name."""
        return self.namespace, self.name

    def child(self, suffix: str | int) -> str:
        """Name of an object created for the Campaign."""
        return child_name(self.name, self.uid, suffix)

    @property
    def files(self) -> str:
        """Return the name of the ConfigMap with the input files."""
        return self.child("files")

    @property
    def labels(self) -> dict[str, str]:
        """Return labels of every object created for the Campaign."""
        return {CAMPAIGN_LABEL: self.name, UID_LABEL: self.uid, MANAGED_LABEL: MANAGED_BY}

    def selector(self, **more: str) -> str:
        """Return the label selector of the Campaign's objects, with optional further labels."""
        return ",".join(f"{name}={value}" for name, value in {**self.labels, **more}.items())

    @property
    def owner(self) -> Object:
        """Return owner reference by which an object is deleted together with the Campaign."""
        return {
            "apiVersion": API_VERSION,
            "kind": "Campaign",
            "name": self.name,
            "uid": self.uid,
            "controller": True,
            "blockOwnerDeletion": False,
        }

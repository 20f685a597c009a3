"""The volumes of a pod, and where our containers find them."""

from __future__ import annotations

from enum import StrEnum
from typing import Any

Object = dict[str, Any]

PLAN_FILE = "campaign.json"
"""In `Mount.PLAN`: a `CampaignPlan`."""
DOCUMENT_FILE = "document.vast"
"""In `Mount.PLAN`: the document that the plan was made from."""


class Mount(StrEnum):
    """Name of a volume, which is also its folder in our containers."""

    PLAN = "plan"
    FILES = "files"
    CREDENTIALS = "credentials"
    GIT = "git"
    SHARE = "share"
    RECEIVERS = "receivers"
    PODS = "pods"
    WORK = "work"

    @property
    def path(self) -> str:
        """Its path in our containers."""
        return f"/robovast/{self}"

    @property
    def mount(self) -> Object:
        """The mount in our containers, read-only except for the pod's own volume."""
        read_only = {} if self is Mount.WORK else {"readOnly": True}
        return {"name": str(self), "mountPath": self.path, **read_only}

    def secret(self, name: str) -> Object:
        """The volume with a Secret, readable for our user only."""
        return {"name": str(self), "secret": {"secretName": name, "defaultMode": SECRET_MODE}}


SECRET_MODE = 0o440

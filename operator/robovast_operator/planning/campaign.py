"""An accepted Campaign: everything that its objects are made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from robovast.kubeapi.pod_contract.storage_address import joined_address
from robovast.kubeapi.resources import (
    CampaignSpec,
)
from robovast.model.document.model import Vast
from robovast.model.packs import CampaignPlan, Entry, Owner, PlanSpec
from robovast.model.seeds import hashed_seed
from robovast.storage.bucket_names import bucket_name, campaign_id
from robovast_operator.kube.objects import Identity, Object
from robovast_operator.kube.times import parse_time


@dataclass(frozen=True)
class Accepted:
    """A Campaign whose spec and document are valid."""

    identity: Identity
    spec: CampaignSpec
    vast: Vast
    document_text: str
    """YAML of the document."""
    image: str
    pure: bool
    """Whether the operator may expand the document itself."""
    entries: tuple[Entry, ...] = ()
    """The expansion of the document; empty if the compose Job expands it."""
    breaks: str = ""
    """`PlanSpec.breaks` of it."""
    composed: str | None = None
    """`CampaignPlan.composed`."""
    inputs: Mapping[str, str] = field(default_factory=dict)
    """`CampaignPlan.inputs`."""
    planned: CampaignPlan | None = None
    """The existing plan of its pods, if any; the place of the results is fixed from then on."""
    default_endpoint: str = ""
    default_region: str | None = None

    @property
    def is_search(self) -> bool:
        """Return whether a search proposes the runs."""
        return self.vast.search is not None

    @property
    def runs(self) -> int:
        """Return the number of runs of each variant."""
        return self.spec.runs or self.vast.execution.most_runs

    @property
    def as_needed(self) -> bool:
        """Return whether verdicts decide how many runs are needed."""
        return self.vast.execution.test() is not None

    @property
    def seed(self) -> int:
        """Return seed of the campaign.

        Without one in the document it follows from the object's uid, which is drawn once and lasts.
        """
        if self.planned is not None:
            return self.planned.seed
        given = self.vast.execution.seed
        return hashed_seed(self.identity.uid) if given is None else given

    @property
    def campaign(self) -> str:
        """Name of the results folder."""
        created = parse_time(self.identity.created)
        return campaign_id(self.vast.metadata, self.identity.name, created)

    @property
    def bucket(self) -> str:
        """Return the bucket of the results."""
        if self.planned is not None:
            return self.planned.bucket
        prefix = self.spec.storage.prefix or ""
        return bucket_name(self.campaign, prefix, self.identity.uid)

    @property
    def owner(self) -> Owner:
        """Return the owner that the bucket names."""
        if self.planned is not None:
            return self.planned.owner
        identity = self.identity
        return Owner(
            uid=identity.uid,
            namespace=identity.namespace,
            name=identity.name,
            campaign=self.campaign,
        )

    @property
    def endpoint(self) -> str:
        """Return the URL of the S3 server for pods."""
        return self.spec.storage.endpoint or self.default_endpoint

    @property
    def region(self) -> str | None:
        """Return region of the S3 server."""
        return self.spec.storage.region or self.default_region

    @property
    def address(self) -> str:
        """Return the S3 server in the format of `JobState.address`."""
        return joined_address(self.endpoint, self.region)

    @property
    def document_name(self) -> str:
        """Return file name of the document."""
        return self.spec.document or f"{self.identity.name}.vast"


@dataclass(frozen=True)
class Rejected:
    """A Campaign that cannot be executed as it is."""

    reason: str
    """CamelCase reason of the condition."""
    message: str


@dataclass(frozen=True)
class Revision:
    """A plan in a ConfigMap; later revisions only append to it."""

    number: int
    config_map: str
    plan: PlanSpec
    entries: tuple[Entry, ...] = ()
    owners: dict[int, Object] = field(default_factory=dict)
    """Owner references of the blocks that belong to a Configuration object."""
    document: str = ""
    """Text of the document."""
    composed: str | None = None
    """`CampaignPlan.composed`."""

    def next_name(self, identity: Identity) -> str:
        """Return the name of the ConfigMap of the next plan."""
        return identity.child(f"plan-{self.number + 1}")

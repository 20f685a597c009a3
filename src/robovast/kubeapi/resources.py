"""The custom resources: what may stand in a Campaign and in a Configuration.

These models are what the CRDs are generated from (`robovast.kubeapi.crd`), what the operator
reads, and what the command line writes. Keys are spelled as Kubernetes spells them.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.alias_generators import to_camel

from robovast.base import docstrings
from robovast.base.containers import IMAGE
from robovast.kubeapi.names import CREDENTIALS_SECRET
from robovast.kubeapi.secret_names import MADE_FOR_CAMPAIGNS

GROUP = "robovast.io"
VERSION = "v1beta1"
API_VERSION = f"{GROUP}/{VERSION}"

CAMPAIGN_LABEL = f"{GROUP}/campaign"
"""Name of the Campaign, on every object that is made for it."""
UID_LABEL = f"{GROUP}/campaign-uid"
"""Uid of the Campaign: two of one name, one after the other, differ."""
ROLE_LABEL = f"{GROUP}/role"
"""What our Jobs and their pods do: `shard`, `compose`, `finish`, `process`, `purge`, `notify` or
`share`; a pod alone: `debug`."""
SHARD_ROLE = "shard"
"""Of the Jobs that execute runs, and of their pods."""
SHARD_LABEL = f"{GROUP}/shard"
"""Number of the shard, on its Job and its pods."""
ASSETS_LABEL = f"{GROUP}/assets"
"""On a PersistentVolumeClaim, `true`: campaigns may read it."""
MANAGED_LABEL = "app.kubernetes.io/managed-by"
MANAGED_BY = "robovast"

DNS_LABEL = r"^[a-z0-9]([-a-z0-9]{0,61}[a-z0-9])?$"
DNS_NAME = r"^[a-z0-9]([-a-z0-9.]{0,251}[a-z0-9])?$"
LABEL_KEY = (
    r"^([a-z0-9]([-a-z0-9.]{0,251}[a-z0-9])?/)?[A-Za-z0-9]([-A-Za-z0-9_.]{0,61}[A-Za-z0-9])?$"
)


class _Spec(BaseModel):
    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        use_attribute_docstrings=docstrings.READ,
        alias_generator=to_camel,
        populate_by_name=True,
    )


ObjectName = Annotated[str, Field(pattern=DNS_NAME, max_length=253)]
SecretName = Annotated[ObjectName, MADE_FOR_CAMPAIGNS]
FilePath = Annotated[str, Field(min_length=1, max_length=253)]


class InlineFiles(_Spec):
    """Small files that stand in the Campaign itself."""

    files: Annotated[dict[str, str], Field(max_length=500)] = Field(default_factory=dict)
    """Text by path, relative to the document."""
    binary_files: Annotated[dict[str, str], Field(max_length=500)] = Field(default_factory=dict)
    """Base64 by path, relative to the document."""


class KeyToPath(_Spec):
    """One key of a ConfigMap and the file that it becomes."""

    key: Annotated[str, Field(pattern=r"^[-._a-zA-Z0-9]+$", max_length=253)]
    """Key in the ConfigMap."""
    path: FilePath
    """Path of the file, relative to the document."""


class ConfigMapSource(_Spec):
    """Files from a ConfigMap of the same namespace."""

    name: ObjectName
    """Name of the ConfigMap."""
    items: Annotated[list[KeyToPath], Field(max_length=500)] = Field(default_factory=list)
    """Paths of its keys, as in a volume; without any, each key is a file name."""


class BundleSource(_Spec):
    """A `.tar.gz` of the document's folder in S3."""

    key: Annotated[str, Field(min_length=1, max_length=1024)]
    """Key of the object."""
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    """Checksum of the object; another content is refused."""
    bucket: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9.-]{1,61}[a-z0-9]$")] | None = None
    """Its bucket; default `robovast-bundles`."""


class GitRepository(_Spec):
    """A folder of a Git repository."""

    url: Annotated[str, Field(pattern=r"^(https?|ssh|git|file)://.+$", max_length=1024)]
    """URL of the repository."""
    ref: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._/-]*$", max_length=250)]
    """Commit, tag or branch; only a commit names the same content for ever."""
    path: Annotated[str, Field(max_length=1024)] = ""
    """Folder in the repository; default its top."""
    secret_name: SecretName | None = None
    """Secret of the namespace with `username` and `password` of an account, for an `https` URL."""


class Source(_Spec):
    """The files that belong to the document: at most one of these."""

    inline: InlineFiles | None = None
    """Files in the Campaign itself, up to about 700 kB together."""
    config_map: ConfigMapSource | None = None
    """Files from a ConfigMap."""
    bundle: BundleSource | None = None
    """Files from an archive in S3."""
    git: GitRepository | None = None
    """Files from a Git repository."""


class Storage(_Spec):
    """Where results go."""

    secret_name: SecretName = CREDENTIALS_SECRET
    """Secret of the namespace with `accessKey` and `secretKey`."""
    endpoint: Annotated[str, Field(pattern=r"^https?://.+$", max_length=1024)] | None = None
    """URL of the S3 server as pods reach it; default that of the installation."""
    region: Annotated[str, Field(max_length=100)] | None = None
    """Region, where the server has any."""
    prefix: Annotated[str, Field(pattern=r"^[a-z0-9]([a-z0-9-]{0,29})$")] | None = None
    """Begins the bucket's name."""
    retention: Literal["Retain", "Delete"] = "Retain"
    """Whether the bucket stays when the Campaign is deleted. `Delete` sets a finalizer."""


class ShareTarget(_Spec):
    """A place outside of the cluster that a campaign's results are uploaded to."""

    secret_name: SecretName
    """Secret of the namespace with the variables that describe it, as `ROBOVAST_SHARE_TYPE`."""


class Acceptance(_Spec):
    """When a campaign has passed."""

    min_pass_ratio: Annotated[str, Field(pattern=r"^(0(\.[0-9]+)?|1(\.0+)?)$", max_length=20)] = "1"  # noqa: S105
    """Least share of passed runs, `0` to `1`."""


class FailFast(_Spec):
    """When a campaign is given up before its end."""

    max_failed: Annotated[int, Field(ge=0, le=1_000_000)] | None = None
    """Most runs that may fail; one more ends the campaign."""
    max_errored: Annotated[int, Field(ge=0, le=1_000_000)] | None = None
    """Most runs that may end by an error; one more ends the campaign."""


class Toleration(_Spec):
    """A taint that pods tolerate."""

    key: Annotated[str, Field(pattern=LABEL_KEY, max_length=317)] | None = None
    """Key of the taint."""
    operator: Literal["Exists", "Equal"] = "Equal"
    """How `value` is compared."""
    value: Annotated[str, Field(max_length=63)] | None = None
    """Value of the taint."""
    effect: Literal["NoSchedule", "PreferNoSchedule", "NoExecute"] | None = None
    """Effect of the taint; default any."""
    toleration_seconds: Annotated[int, Field(ge=0)] | None = None
    """How long `NoExecute` is tolerated [s]."""


class NodeRequirement(_Spec):
    """What a label of a node must be."""

    key: Annotated[str, Field(pattern=LABEL_KEY, max_length=317)]
    """Key of the label."""
    operator: Literal["In", "NotIn", "Exists", "DoesNotExist", "Gt", "Lt"] = "In"
    """How it is compared with `values`."""
    values: Annotated[list[Annotated[str, Field(max_length=63)]], Field(max_length=50)] = Field(
        default_factory=list
    )
    """Values, of which one must match; none for `Exists` and `DoesNotExist`."""

    @model_validator(mode="after")
    def _values_are_compared(self) -> NodeRequirement:
        if (self.operator in ("Exists", "DoesNotExist")) != (not self.values):
            raise ValueError(COMPARED_VALUES)
        return self


COMPARED_VALUES = "`Exists` and `DoesNotExist` have no `values`; all other operators need some"


class NodePreference(NodeRequirement):
    """What a label of a node should be."""

    weight: Annotated[int, Field(ge=1, le=100)] = 1
    """How much it counts beside others."""


class NodeAffinity(_Spec):
    """Which nodes pods may be on."""

    required: Annotated[list[NodeRequirement], Field(max_length=20)] = Field(default_factory=list)
    """What holds for every node that they may be on, all of it."""
    preferred: Annotated[list[NodePreference], Field(max_length=20)] = Field(default_factory=list)
    """What holds for nodes that are taken first."""


class TopologySpread(_Spec):
    """Over what the pods of the campaign's runs are spread."""

    topology_key: Annotated[str, Field(pattern=LABEL_KEY, max_length=317)]
    """Label of nodes: all with one value of it are one place."""
    max_skew: Annotated[int, Field(ge=1, le=10_000)] = 1
    """Most pods that one place may have more than another."""
    when_unsatisfiable: Literal["DoNotSchedule", "ScheduleAnyway"] = "ScheduleAnyway"
    """Whether pods wait when it cannot be kept."""


class SecretReference(_Spec):
    """A Secret of the namespace."""

    name: SecretName
    """Its name."""


LabelValue = Annotated[str, Field(pattern=r"^([A-Za-z0-9]([-A-Za-z0-9_.]{0,61}[A-Za-z0-9])?)?$")]


class Scheduling(_Spec):
    """What may be said about pods; never a free patch of them."""

    node_selector: Annotated[dict[str, str], Field(max_length=50)] = Field(default_factory=dict)
    """Labels that a node must have, beside those of the document."""
    tolerations: Annotated[list[Toleration], Field(max_length=50)] = Field(default_factory=list)
    """Taints that the pods tolerate."""
    priority_class_name: ObjectName | None = None
    """Priority class of the pods."""
    runtime_class_name: ObjectName | None = None
    """Runtime class of the pods."""
    node_affinity: NodeAffinity = Field(default_factory=NodeAffinity)
    """Nodes that pods may be on, or rather should be on."""
    topology_spread: Annotated[list[TopologySpread], Field(max_length=5)] = Field(
        default_factory=list
    )
    """How the pods of runs are spread over nodes or zones."""
    image_pull_secrets: Annotated[list[SecretReference], Field(max_length=20)] = Field(
        default_factory=list
    )
    """Secrets of the namespace that pull private images."""
    pod_annotations: Annotated[dict[str, str], Field(max_length=20)] = Field(default_factory=dict)
    """Annotations of the pods, from the list that an administrator allows."""
    pod_labels: Annotated[dict[str, LabelValue], Field(max_length=20)] = Field(default_factory=dict)
    """Labels of the pods, from the list that an administrator allows."""


class SecretKey(SecretReference):
    """One key of a Secret of the namespace."""

    key: Annotated[str, Field(pattern=r"^[-._a-zA-Z0-9]+$", max_length=253)]
    """Key in the Secret."""


HttpUrl = Annotated[str, Field(pattern=r"^https?://[!-~]+$", max_length=2048)]
Subject = Literal["Started", "Progress", "Finished", "Trouble"]
SUBJECTS: tuple[Subject, ...] = get_args(Subject)


class Notification(_Spec):
    """Somebody who is told when a campaign ends, or when it needs help."""

    kind: Literal["ntfy", "webhook"]
    """`ntfy` is told in its own way; a `webhook` gets JSON."""
    url: HttpUrl | None = None
    """Where to: for ntfy the topic, `https://ntfy.sh/TOPIC`."""
    url_from: SecretKey | None = None
    """The same from a Secret, for a URL that nobody may read."""
    token_from: SecretKey | None = None
    """Token of an account, from a Secret; sent as `Authorization: Bearer`."""
    subjects: Annotated[list[Subject], Field(min_length=1, max_length=len(SUBJECTS))] = Field(
        default_factory=lambda: list[Subject](["Finished", "Trouble"])
    )
    """What about; default its end and trouble."""
    link: HttpUrl | None = None
    """Page that the message leads to."""

    @model_validator(mode="after")
    def _one_address(self) -> Notification:
        if (self.url is None) == (self.url_from is None):
            raise ValueError(ONE_ADDRESS)
        return self


ONE_ADDRESS = "a notification has an address: either `url` or `urlFrom`"

NOTIFICATIONS_LIMIT = 5


class CampaignSpec(_Spec):
    """A campaign: a .vast document and how to execute it."""

    vast: dict[str, Any]
    """The .vast document, in its own spelling."""
    document: (
        Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*\.vast$", max_length=100)] | None
    ) = None
    """File name of the document in the results; default the Campaign's name and `.vast`."""
    source: Source = Field(default_factory=Source)
    """Files that belong to the document."""
    image: Annotated[str, Field(pattern=IMAGE, max_length=500)] | None = None
    """Container image; replaces `execution.image` of the .vast file."""
    cluster: Annotated[str, Field(max_length=253)] | None = None
    """Name of this cluster in values that the document gives per cluster."""
    select: Annotated[
        list[Annotated[str, Field(min_length=1, max_length=253)]], Field(max_length=100)
    ] = Field(default_factory=list)
    """Patterns of configuration names, as `hall-*`; default all."""
    runs: Annotated[int, Field(ge=1, le=100_000)] | None = None
    """Runs of each configuration, in place of the document's. May be raised at any time."""
    parallelism: Annotated[int, Field(ge=1, le=10_000)] = 100
    """Most pods at once."""
    attempt: Annotated[int, Field(ge=1, le=1000)] = 1
    """Raised by one, all failed and errored runs are executed once more."""
    suspend: bool = False
    """Stops all pods; set back, the campaign goes on after its last stored run."""
    queue_name: Annotated[str, Field(pattern=DNS_LABEL, max_length=63)] | None = None
    """Kueue LocalQueue that admits the campaign's Jobs."""
    queue_priority_class_name: ObjectName | None = None
    """Kueue WorkloadPriorityClass of the campaign's Jobs: what is higher comes first in a queue."""
    reuse: bool = False
    """Take over runs that other campaigns of the storage have stored with the same inputs and seed,
    if they have it set, too. The image needs a digest, and the document a seed."""
    options: Annotated[str, Field(pattern=r"^[-A-Za-z0-9_=. ]*$", max_length=500)] = ""
    """Further options of the scenario execution, as `-t -d`."""
    storage: Storage = Field(default_factory=Storage)
    """Where results go."""
    share: ShareTarget | None = None
    """Where an archive of the results is uploaded to whenever they are complete."""
    process_results: bool = False
    """Work the results up in the cluster, too, as the document's `results_processing` says."""
    acceptance: Acceptance = Field(default_factory=Acceptance)
    """When the campaign has passed."""
    fail_fast: FailFast = Field(default_factory=FailFast)
    """When the campaign is given up."""
    scheduling: Scheduling = Field(default_factory=Scheduling)
    """Where and how pods are scheduled."""
    notifications: Annotated[list[Notification], Field(max_length=NOTIFICATIONS_LIMIT)] = Field(
        default_factory=list
    )
    """Who is told when the campaign ends, or needs help."""
    ttl_seconds_after_finished: Annotated[int, Field(ge=0)] | None = None
    """When Jobs and pods of a finished campaign are removed [s]; the Campaign stays."""


ENTRY_KEYS = ("parameters", "variations", "design")
"""Keys of a document's entry that a Configuration has, too."""


class ConfigurationSpec(_Spec):
    """One configuration entry of a campaign."""

    campaign: ObjectName
    """Name of the Campaign, in the same namespace."""
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$")] | None = None
    """Name of the entry: the results folders begin with it; default that of this object."""
    parameters: list[dict[str, Any]] | None = None
    """Fixed scenario parameters, one `name: value` pair an item."""
    variations: list[Any] | None = None
    """Variations in order, as in a .vast document."""
    design: dict[str, Any] | None = None
    """Which combinations of the variations' values are made, as in a .vast document."""
    runs: Annotated[int, Field(ge=1, le=100_000)] | None = None
    """Runs of each of its variants; default those of the campaign."""

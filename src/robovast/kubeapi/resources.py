"""The specs of the custom resources Campaign and Configuration.

The CRDs are generated from these models (`robovast.kubeapi.crd`). The operator reads the specs, and
the command line writes the specs. Keys are in camel case, as in Kubernetes.
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
"""Label with the name of the Campaign, on every object that is created for a Campaign."""
UID_LABEL = f"{GROUP}/campaign-uid"
"""Label with the uid of the Campaign, because a later Campaign may have the same name."""
ROLE_LABEL = f"{GROUP}/role"
"""Label with the role of a Job and its pods: `shard`, `compose`, `propose`, `finish`, `process`,
`purge`, `notify` or `share`. A pod without a Job has the role `debug`."""
SHARD_ROLE = "shard"
"""Role of the Jobs with runs, and of their pods."""
SHARD_LABEL = f"{GROUP}/shard"
"""Label with the number of the shard, on the Job and its pods."""
ASSETS_LABEL = f"{GROUP}/assets"
"""Label of PersistentVolumeClaims that campaigns may read; the value is `true`."""
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
    """Small files inside the Campaign."""

    files: Annotated[dict[str, str], Field(max_length=500)] = Field(default_factory=dict)
    """Text files by path, relative to the .vast file."""
    binary_files: Annotated[dict[str, str], Field(max_length=500)] = Field(default_factory=dict)
    """Base64-encoded files by path, relative to the .vast file."""


class KeyToPath(_Spec):
    """One key of a ConfigMap and the path of its file."""

    key: Annotated[str, Field(pattern=r"^[-._a-zA-Z0-9]+$", max_length=253)]
    """Key in the ConfigMap."""
    path: FilePath
    """Path of the file, relative to the .vast file."""


class ConfigMapSource(_Spec):
    """Files from a ConfigMap of the same namespace."""

    name: ObjectName
    """Name of the ConfigMap."""
    items: Annotated[list[KeyToPath], Field(max_length=500)] = Field(default_factory=list)
    """Paths of the keys, as in a volume (default: each key is a file name)."""


class BundleSource(_Spec):
    """A `.tar.gz` archive with the folder of the .vast file, in object storage (S3)."""

    key: Annotated[str, Field(min_length=1, max_length=1024)]
    """Key of the object."""
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    """SHA-256 of the object. The operator rejects other content."""
    bucket: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9.-]{1,61}[a-z0-9]$")] | None = None
    """Bucket of the object (default: `robovast-bundles`)."""


class GitRepository(_Spec):
    """A folder of a Git repository."""

    url: Annotated[str, Field(pattern=r"^(https?|ssh|git|file)://.+$", max_length=1024)]
    """URL of the repository."""
    ref: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._/-]*$", max_length=250)]
    """Commit, tag or branch. Only a commit always has the same content."""
    path: Annotated[str, Field(max_length=1024)] = ""
    """Folder in the repository (default: the top folder)."""
    secret_name: SecretName | None = None
    """Secret in the namespace with `username` and `password` of an account, for an `https` URL."""


class CampaignSource(_Spec):
    """Source of the files that belong to the .vast file: at most one of these keys."""

    inline: InlineFiles | None = None
    """Files inside the Campaign, up to about 700 kB in total."""
    config_map: ConfigMapSource | None = None
    """Files from a ConfigMap."""
    bundle: BundleSource | None = None
    """Files from an archive in object storage (S3)."""
    git: GitRepository | None = None
    """Files from a Git repository."""


class Storage(_Spec):
    """Object storage of the results."""

    secret_name: SecretName = CREDENTIALS_SECRET
    """Secret in the namespace with `accessKey` and `secretKey`."""
    endpoint: Annotated[str, Field(pattern=r"^https?://.+$", max_length=1024)] | None = None
    """URL of the S3 server for pods (default: the server of the installation)."""
    region: Annotated[str, Field(max_length=100)] | None = None
    """Region of the S3 server (default: none)."""
    prefix: Annotated[str, Field(pattern=r"^[a-z0-9]([a-z0-9-]{0,29})$")] | None = None
    """Prefix of the name of the bucket."""
    retention: Literal["Retain", "Delete"] = "Retain"
    """Whether the bucket stays when the Campaign is deleted. `Delete` adds a finalizer."""


class ShareTarget(_Spec):
    """A remote file share outside the cluster that receives the results."""

    secret_name: SecretName
    """Secret in the namespace with the variables of the share, such as `ROBOVAST_SHARE_TYPE`."""


class Acceptance(_Spec):
    """Condition under which a campaign passes."""

    min_pass_ratio: Annotated[str, Field(pattern=r"^(0(\.[0-9]+)?|1(\.0+)?)$", max_length=20)] = "1"  # noqa: S105
    """Minimum fraction of passed runs, from `0` to `1`."""


class FailFast(_Spec):
    """Conditions under which a campaign is aborted."""

    max_failed: Annotated[int, Field(ge=0, le=1_000_000)] | None = None
    """Maximum number of failed runs. One more failed run aborts the campaign."""
    max_errored: Annotated[int, Field(ge=0, le=1_000_000)] | None = None
    """Maximum number of errored runs. One more errored run aborts the campaign."""


class Toleration(_Spec):
    """A taint that pods tolerate."""

    key: Annotated[str, Field(pattern=LABEL_KEY, max_length=317)] | None = None
    """Key of the taint."""
    operator: Literal["Exists", "Equal"] = "Equal"
    """Operator that compares `value`."""
    value: Annotated[str, Field(max_length=63)] | None = None
    """Value of the taint."""
    effect: Literal["NoSchedule", "PreferNoSchedule", "NoExecute"] | None = None
    """Effect of the taint (default: any)."""
    toleration_seconds: Annotated[int, Field(ge=0)] | None = None
    """Time for which `NoExecute` is tolerated, in seconds."""


class NodeRequirement(_Spec):
    """A requirement on a label of a node."""

    key: Annotated[str, Field(pattern=LABEL_KEY, max_length=317)]
    """Key of the label."""
    operator: Literal["In", "NotIn", "Exists", "DoesNotExist", "Gt", "Lt"] = "In"
    """Operator that compares the label with `values`."""
    values: Annotated[list[Annotated[str, Field(max_length=63)]], Field(max_length=50)] = Field(
        default_factory=list
    )
    """Values. One value must match. Must be empty for `Exists` and `DoesNotExist`."""

    @model_validator(mode="after")
    def _values_are_compared(self) -> NodeRequirement:
        if (self.operator in ("Exists", "DoesNotExist")) != (not self.values):
            raise ValueError(COMPARED_VALUES)
        return self


COMPARED_VALUES = (
    "`Exists` and `DoesNotExist` must have no `values`, all other operators need at least one"
)


class NodePreference(NodeRequirement):
    """A preference for a label of a node."""

    weight: Annotated[int, Field(ge=1, le=100)] = 1
    """Weight of the preference, compared with other preferences."""


class NodeAffinity(_Spec):
    """Requirements on nodes, and preferences."""

    required: Annotated[list[NodeRequirement], Field(max_length=20)] = Field(default_factory=list)
    """Requirements that a node must meet, all of them."""
    preferred: Annotated[list[NodePreference], Field(max_length=20)] = Field(default_factory=list)
    """Preferences for nodes."""


class TopologySpread(_Spec):
    """Rule that spreads the run pods of the campaign over nodes or zones."""

    topology_key: Annotated[str, Field(pattern=LABEL_KEY, max_length=317)]
    """Label of nodes. Nodes with the same value are one topology domain."""
    max_skew: Annotated[int, Field(ge=1, le=10_000)] = 1
    """Maximum difference between the numbers of pods of two domains."""
    when_unsatisfiable: Literal["DoNotSchedule", "ScheduleAnyway"] = "ScheduleAnyway"
    """Whether pods wait if the rule cannot be met."""


class SecretReference(_Spec):
    """A Secret in the namespace."""

    name: SecretName
    """Name of the Secret."""


LabelValue = Annotated[str, Field(pattern=r"^([A-Za-z0-9]([-A-Za-z0-9_.]{0,61}[A-Za-z0-9])?)?$")]


class Scheduling(_Spec):
    """Scheduling of pods, limited to safe fields."""

    node_selector: Annotated[dict[str, str], Field(max_length=50)] = Field(default_factory=dict)
    """Labels that a node must have, in addition to the labels in the .vast file."""
    tolerations: Annotated[list[Toleration], Field(max_length=50)] = Field(default_factory=list)
    """Taints that the pods tolerate."""
    priority_class_name: ObjectName | None = None
    """Priority class of the pods."""
    runtime_class_name: ObjectName | None = None
    """Runtime class of the pods."""
    node_affinity: NodeAffinity = Field(default_factory=NodeAffinity)
    """Required and preferred nodes."""
    topology_spread: Annotated[list[TopologySpread], Field(max_length=5)] = Field(
        default_factory=list
    )
    """Rules that spread run pods over nodes or zones."""
    image_pull_secrets: Annotated[list[SecretReference], Field(max_length=20)] = Field(
        default_factory=list
    )
    """Secrets in the namespace that pull private images."""
    pod_annotations: Annotated[dict[str, str], Field(max_length=20)] = Field(default_factory=dict)
    """Annotations of the pods. Your administrator allows keys (chart value
    `policies.podMetadata.annotations`)."""
    pod_labels: Annotated[dict[str, LabelValue], Field(max_length=20)] = Field(default_factory=dict)
    """Labels of the pods. Your administrator allows keys (chart value
    `policies.podMetadata.labels`)."""


class SecretKey(SecretReference):
    """One key of a Secret in the namespace."""

    key: Annotated[str, Field(pattern=r"^[-._a-zA-Z0-9]+$", max_length=253)]
    """Key in the Secret."""


HttpUrl = Annotated[str, Field(pattern=r"^https?://[!-~]+$", max_length=2048)]
Subject = Literal["Started", "Progress", "Finished", "Trouble"]
SUBJECTS: tuple[Subject, ...] = get_args(Subject)


class Notification(_Spec):
    """A notification target."""

    kind: Literal["ntfy", "webhook"]
    """`ntfy` gets a message in the format of ntfy. `webhook` gets JSON."""
    url: HttpUrl | None = None
    """URL of the target. For ntfy, the URL of the topic, such as `https://ntfy.sh/TOPIC`."""
    url_from: SecretKey | None = None
    """Secret with the URL of the target, for a confidential URL."""
    token_from: SecretKey | None = None
    """Secret with the token of an account. The token is sent as `Authorization: Bearer`."""
    subjects: Annotated[list[Subject], Field(min_length=1, max_length=len(SUBJECTS))] = Field(
        default_factory=lambda: list[Subject](["Finished", "Trouble"])
    )
    """Events that cause a notification. `Trouble` stands for the condition `Stalled` (default:
    `Finished` and `Trouble`)."""
    link: HttpUrl | None = None
    """URL of the link in the notification."""

    @model_validator(mode="after")
    def _one_address(self) -> Notification:
        if (self.url is None) == (self.url_from is None):
            raise ValueError(ONE_ADDRESS)
        return self


ONE_ADDRESS = "a notification needs exactly one address: `url` or `urlFrom`"

NOTIFICATIONS_LIMIT = 5


class CampaignSpec(_Spec):
    """A campaign: a .vast file and the settings of its runs."""

    vast: dict[str, Any]
    """Content of the .vast file."""
    document: (
        Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*\.vast$", max_length=100)] | None
    ) = None
    """Name of the .vast file in the results (default: the name of the Campaign and `.vast`)."""
    source: CampaignSource = Field(default_factory=CampaignSource)
    """Source of the files that belong to the .vast file."""
    image: Annotated[str, Field(pattern=IMAGE, max_length=500)] | None = None
    """Container image (default: `execution.image` of the .vast file)."""
    cluster: Annotated[str, Field(max_length=253)] | None = None
    """Name of this cluster, for values that the .vast file sets per cluster."""
    select: Annotated[
        list[Annotated[str, Field(min_length=1, max_length=253)]], Field(max_length=100)
    ] = Field(default_factory=list)
    """Names or patterns of configurations, such as `hall-*` (default: all)."""
    runs: Annotated[int, Field(ge=1, le=100_000)] | None = None
    """Runs of each configuration (default: `execution.runs` of the .vast file). You can raise the
    number at any time."""
    parallelism: Annotated[int, Field(ge=1, le=10_000)] = 100
    """Maximum number of concurrent run pods."""
    attempt: Annotated[int, Field(ge=1, le=1000)] = 1
    """Number of the attempt. Raise the number by one to repeat all failed and errored runs."""
    suspend: bool = False
    """Stops all pods. `false` resumes the campaign after the last stored run."""
    queue_name: Annotated[str, Field(pattern=DNS_LABEL, max_length=63)] | None = None
    """Kueue LocalQueue that admits the campaign's Jobs."""
    queue_priority_class_name: ObjectName | None = None
    """Kueue WorkloadPriorityClass of the campaign's Jobs. Higher priorities are admitted first."""
    reuse: bool = False
    """Reuses runs with identical inputs and seed of other campaigns in the object storage that also
    set `reuse`. The image needs a digest, and the .vast file a seed."""
    options: Annotated[str, Field(pattern=r"^[-A-Za-z0-9_=. ]*$", max_length=500)] = ""
    """Further options of scenario-execution, such as `-t -d`."""
    storage: Storage = Field(default_factory=Storage)
    """Object storage of the results."""
    share: ShareTarget | None = None
    """Remote file share that receives an archive of the results when the results are complete."""
    process_results: bool = False
    """Postprocesses the results in the cluster (`results_processing` of the .vast file)."""
    acceptance: Acceptance = Field(default_factory=Acceptance)
    """Condition under which the campaign passes."""
    fail_fast: FailFast = Field(default_factory=FailFast)
    """Conditions under which the campaign is aborted."""
    scheduling: Scheduling = Field(default_factory=Scheduling)
    """Scheduling of pods."""
    notifications: Annotated[list[Notification], Field(max_length=NOTIFICATIONS_LIMIT)] = Field(
        default_factory=list
    )
    """Notification targets."""
    ttl_seconds_after_finished: Annotated[int, Field(ge=0)] | None = None
    """Seconds after which Jobs and pods of a finished campaign are deleted. The Campaign stays."""


ENTRY_KEYS = ("parameters", "variations", "design")
"""Keys of a configuration entry that a Configuration also has."""


class ConfigurationSpec(_Spec):
    """One configuration entry of a campaign."""

    campaign: ObjectName
    """Name of the Campaign, in the same namespace."""
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$")] | None = None
    """Name of the configuration entry, and prefix of its results folders (default: the name of this
    object)."""
    parameters: list[dict[str, Any]] | None = None
    """Fixed scenario parameters, one `name: value` pair per item."""
    variations: list[Any] | None = None
    """Variations in order, as in a .vast file."""
    design: dict[str, Any] | None = None
    """Combination design of the variations, as in a .vast file."""
    runs: Annotated[int, Field(ge=1, le=100_000)] | None = None
    """Runs of each configuration (default: the runs of the campaign)."""

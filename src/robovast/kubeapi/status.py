"""The status of the custom resources; it never grows with the number of runs."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from pydantic.alias_generators import to_camel

from robovast.base import docstrings
from robovast.base.ranges import parse_ranges
from robovast.campaign.decisions import DECISIONS_LIMIT
from robovast.model.repetition import GroupSizes

RANGES_LIMIT = 16_384
"""Maximum length of the ranges of unsuccessful runs [characters]. The index is complete."""

SHARDS_LIMIT = 512
"""Maximum number of shards in a status. Older shards are only counted."""

NOTIFIED_LIMIT = 50

FAILING_LIMIT = 10

YEARS = range(1970, 3000)
"""Years of valid times."""


def check_time(text: str) -> str:
    """Return a time unchanged if it has the format of Kubernetes.

    Raises:
        ValueError: the time has another format.
    """
    moment = datetime.fromisoformat(text)
    if moment.tzinfo is None or moment.year not in YEARS:
        raise ValueError(f"{text} is not a time such as 2026-11-21T07:00:00Z")
    return text


def _check_ranges(text: str) -> str:
    parse_ranges(text)
    return text


def _check_sizes(text: str) -> str:
    return str(GroupSizes.parse(text))


def _check_given_time(text: str) -> str:
    return check_time(text) if text else text


Time = Annotated[str, AfterValidator(_check_given_time)]
Ranges = Annotated[str, AfterValidator(_check_ranges)]


class Lenient(BaseModel):
    """Data of another version of RoboVAST. Unknown keys are ignored."""

    model_config = ConfigDict(
        extra="ignore",
        frozen=True,
        use_attribute_docstrings=docstrings.READ,
        alias_generator=to_camel,
        populate_by_name=True,
    )


class Condition(Lenient):
    """A condition in the format of Kubernetes."""

    type: str
    """Type of the condition, in CamelCase."""
    status: Literal["True", "False", "Unknown"]
    """Status of the condition."""
    reason: str
    """Reason of the last transition, in CamelCase."""
    message: str = ""
    """Cause and next step, as text."""
    observed_generation: int = 0
    """Generation of the object for which the condition was set."""
    last_transition_time: Time = ""
    """Time of the last change of `status`."""


class Runs(Lenient):
    """Numbers of runs."""

    total: int = 0
    """Number of all runs."""
    active: int = 0
    """Number of running pods. Each pod runs one run at a time."""
    waiting: int = 0
    """Number of pods that exist but are not running yet (unscheduled, pulling, starting)."""
    passed: int = 0
    """Number of runs whose scenario succeeded."""
    failed: int = 0
    """Number of runs whose scenario failed."""
    errored: int = 0
    """Number of runs that ended for another reason, such as a crash or a timeout."""
    stored: int = 0
    """Number of runs whose results are in the bucket."""
    undecided: int = 0
    """Number of finished runs without a known verdict. The index in the bucket contains it."""

    not_needed: int = 0
    """Number of runs that are not needed, because other runs decided their configuration."""

    @property
    def decided(self) -> int:
        """Return the number of runs with a verdict."""
        return self.passed + self.failed + self.errored

    @property
    def needed(self) -> int:
        """Return the number of runs without the runs that are not needed."""
        return self.total - self.not_needed


class Shard(Lenient):
    """A Kubernetes Job with consecutive jobs of runs."""

    index: int
    """Number of the Kubernetes Job in the campaign."""
    job: str
    """Name of the Kubernetes Job; of the first one, if the Job was created again."""
    state: Literal["Waiting", "Open", "Complete", "Failed"]
    """State. `Failed` means that the Kubernetes Job did not complete."""
    packs: str = ""
    """Range of jobs. In a retry, range of groups of unsuccessful runs."""
    attempt: int = 1
    """Number of the attempt."""
    passed: int = 0
    """Number of passed runs, after the Kubernetes Job has finished."""
    failed: int = 0
    """Number of failed runs, after the Kubernetes Job has finished."""
    errored: int = 0
    """Number of errored runs, after the Kubernetes Job has finished."""
    not_needed: int = 0
    """Number of runs that are not needed, after the Kubernetes Job has finished."""
    configuration: str = ""
    """Configuration object with the runs. Empty if the runs belong to the .vast file."""
    plan: str = ""
    """ConfigMap with the plan."""


class Settled(Lenient):
    """Totals of finished Kubernetes Jobs that are no longer listed."""

    shards: int = 0
    """Number of these Kubernetes Jobs."""
    first: int = 0
    """Number of these Kubernetes Jobs that belong to the first attempt."""
    repeated: int = 0
    """Number of these Kubernetes Jobs that belong to the current retry."""
    passed: int = 0
    """Number of passed runs."""
    failed: int = 0
    """Number of failed runs."""
    errored: int = 0
    """Number of errored runs."""
    not_needed: int = 0
    """Number of runs that are not needed."""


class BadRuns(Lenient):
    """The unsuccessful runs in the last index of the bucket."""

    shards: int
    """Number of Kubernetes Jobs that the index covers."""
    total: int
    """Number of runs that the index covers."""
    attempt: int
    """Attempt after which the index was created."""
    runs: int
    """Number of unsuccessful runs."""
    plan: str
    """ConfigMap with the plan."""
    list: str = ""
    """Name LIST of the list `_transient/bad-runs-LIST.txt` in the bucket. Empty without a list."""
    sizes: Annotated[str, AfterValidator(_check_sizes)] = ""
    """Sizes of the groups that a retry repeats, such as `20x13,4x1`."""


class QueuePlace(Lenient):
    """Position of a waiting campaign in the Kueue queue."""

    position: int
    """Position among all workloads that wait in the ClusterQueue. 1 is the next."""
    pending: int
    """Number of waiting workloads, up to the last workload of this namespace."""
    estimated_start: Time | None = None
    """Estimated start, if earlier workloads continue at the same pace. Absent if unknown."""
    summary: str = ""
    """Summary, such as `3 of 7, about 12 min`."""


class Estimate(Lenient):
    """Estimated completion of a campaign. Changes only when further runs have finished."""

    end: Time
    """Estimated completion."""
    earliest: Time
    """Start of the interval in which nine of ten campaigns complete."""
    latest: Time
    """End of the interval in which nine of ten campaigns complete."""
    cpu_hours: float | None = None
    """CPU-hours that the pods request until the end. Absent if the .vast file sets no CPUs."""


class SearchStatus(Lenient):
    """Progress of a search."""

    batch: int = 0
    """Number of scored batches."""
    evaluated: int = 0
    """Number of scored parameter sets."""
    best: str = ""
    """Best value, such as `failure_rate 0.97`."""
    criteria: str = ""
    """Progress of each criterion, such as `batches 3/50 | failure_rate 0.97/0.9`."""
    stop: str = ""
    """Cause of the end of the search: a criterion, `exhausted`, `errors` or `strategy`."""
    stop_reason: str = ""
    """Cause of the end of the search, as text."""
    plan: str = ""
    """ConfigMap with the plan of this progress."""


class CampaignStatus(Lenient):
    """Status of a campaign."""

    observed_generation: int = 0
    """Generation of the object that this status describes."""
    state: str = "Pending"
    """Summary in one word. Programs read the conditions instead."""
    progress: str = ""
    """Runs with a verdict and needed runs, such as `912/1000`."""
    campaign: str = ""
    """Name of the results folder."""
    bucket: str = ""
    """Bucket of the results."""
    endpoint: str = ""
    """URL of the S3 server for pods."""
    image: str = ""
    """Container image of the runs."""
    attempt: int = 1
    """Number of the current attempt."""
    runs_per_configuration: int = 0
    """Planned runs of each configuration. `spec.runs` cannot be lower."""
    runs: Runs = Field(default_factory=Runs)
    """Numbers of runs."""
    failed_runs: Ranges = ""
    """Ids of failed runs as ranges, such as `17,204-206`."""
    errored_runs: Ranges = ""
    """Ids of errored runs as ranges."""
    ranges_truncated: bool = False
    """Whether ids are missing in the ranges. `_execution/index.json` in the bucket has all ids."""
    failing: Annotated[list[str], Field(max_length=FAILING_LIMIT)] = Field(default_factory=list)
    """Results folders of the first unsuccessful runs."""
    shards: Annotated[list[Shard], Field(max_length=SHARDS_LIMIT)] = Field(default_factory=list)
    """The latest Kubernetes Jobs."""
    finished_shards: int = 0
    """Number of Kubernetes Jobs that the index in the bucket covers."""
    settled: Settled = Field(default_factory=Settled)
    """Totals of finished Kubernetes Jobs that are no longer listed."""
    bad: BadRuns | None = None
    """The unsuccessful runs in the index of the bucket, which `spec.attempt` repeats."""
    search: SearchStatus | None = None
    """Progress of the search, if the .vast file has `search`."""
    decisions: Annotated[str, Field(max_length=DECISIONS_LIMIT)] = ""
    """Decisions about configurations at the end, if `execution.runs` has a rule."""
    queue: QueuePlace | None = None
    """Position in the queue, while the whole campaign waits."""
    estimate: Estimate | None = None
    """Estimated completion, while runs are in progress and at least one run has finished."""
    start_time: Time | None = None
    """Time when the first Kubernetes Job was created, or admitted by the queue."""
    completion_time: Time | None = None
    """Time when the last run finished."""
    shared: str = ""
    """Version of the results that a Job uploads, or has uploaded, to `spec.share`."""
    notified: Annotated[list[str], Field(max_length=NOTIFIED_LIMIT)] = Field(default_factory=list)
    """The latest notifications that were sent to `spec.notifications`."""
    conditions: Annotated[list[Condition], Field(max_length=16)] = Field(default_factory=list)
    """Conditions."""


class ConfigurationStatus(Lenient):
    """Status of a configuration."""

    observed_generation: int = 0
    """Generation of the object that this status describes."""
    variants: int = 0
    """Number of configurations after expansion."""
    progress: str = ""
    """Runs with a verdict and needed runs, such as `18/20`."""
    runs: Runs = Field(default_factory=Runs)
    """Numbers of runs."""
    conditions: Annotated[list[Condition], Field(max_length=16)] = Field(default_factory=list)
    """Conditions."""


Status = TypeVar("Status", bound=Lenient)


def read_status(kind: type[Status], data: object) -> Status:
    """Return the status of an object without invalid fields.

    Other programs or versions may have written the status. Missing fields are computed again.
    """
    given: dict[str, Any] = dict(data) if isinstance(data, Mapping) else {}
    while True:
        try:
            return kind.model_validate(given)
        except ValidationError as error:
            wrong = {to_camel(str(problem["loc"][0])) for problem in error.errors()}
            given = {key: given[key] for key in given if to_camel(str(key)) not in wrong}


def compact(data: Any) -> Any:
    """Return data without empty values, so that objects stay small."""
    if isinstance(data, list):
        return [compact(item) for item in data]
    if not isinstance(data, dict):
        return data
    kept = ((key, compact(value)) for key, value in data.items())
    return {key: value for key, value in kept if value not in ("", [], {})}

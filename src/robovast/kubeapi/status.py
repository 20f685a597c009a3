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
"""Most characters of the ranges of bad runs; the index in the bucket is complete."""

SHARDS_LIMIT = 512
"""Most shards that are told one by one; older ones are remembered as numbers."""

NOTIFIED_LIMIT = 50

FAILING_LIMIT = 10

YEARS = range(1970, 3000)
"""Of times that can be reckoned with."""


def check_time(text: str) -> str:
    """A time as Kubernetes writes it, as it is.

    Raises:
        ValueError: it is none.
    """
    moment = datetime.fromisoformat(text)
    if moment.tzinfo is None or moment.year not in YEARS:
        raise ValueError(f"{text} is no time as 2026-11-21T07:00:00Z")
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
    """Data that another version may have written: unknown keys are ignored."""

    model_config = ConfigDict(
        extra="ignore",
        frozen=True,
        use_attribute_docstrings=docstrings.READ,
        alias_generator=to_camel,
        populate_by_name=True,
    )


class Condition(Lenient):
    """One fact about an object, as Kubernetes writes them."""

    type: str
    """Which fact."""
    status: Literal["True", "False", "Unknown"]
    """Whether it holds."""
    reason: str
    """Why, in one word."""
    message: str = ""
    """Why, for people."""
    observed_generation: int = 0
    """Generation of the object that this is about."""
    last_transition_time: Time = ""
    """When `status` changed."""


class Runs(Lenient):
    """Numbers of runs."""

    total: int = 0
    """All runs."""
    active: int = 0
    """Pods that are at work now, with one run at a time."""
    waiting: int = 0
    """Pods that are there and not at work: without a node or an image yet, or just starting."""
    passed: int = 0
    """Runs whose scenario succeeded."""
    failed: int = 0
    """Runs whose scenario failed."""
    errored: int = 0
    """Runs that something else ended."""
    stored: int = 0
    """Runs whose results are in the bucket."""
    undecided: int = 0
    """Runs that have ended and whose verdict is not known yet; the index in the bucket tells."""

    not_needed: int = 0
    """Runs that are not executed, since others have decided about their configuration."""

    @property
    def decided(self) -> int:
        """Runs with a verdict."""
        return self.passed + self.failed + self.errored

    @property
    def needed(self) -> int:
        """All runs but those that are known not to be needed."""
        return self.total - self.not_needed


class Shard(Lenient):
    """One Job over consecutive packs of runs."""

    index: int
    """Number of the shard."""
    job: str
    """Name of its Job; of one that was made anew for another cluster, that of the first."""
    state: Literal["Waiting", "Open", "Complete", "Failed"]
    """`Failed` when its Job did not come to its end."""
    packs: str = ""
    """Its packs as a range, of a repetition its groups of bad runs."""
    attempt: int = 1
    """1, or the repetition that it belongs to."""
    passed: int = 0
    """Of a shard that has ended: its runs that passed."""
    failed: int = 0
    """Of a shard that has ended: its runs that failed."""
    errored: int = 0
    """Of a shard that has ended: its runs that errored."""
    not_needed: int = 0
    """Of a shard that has ended: its runs that are not needed."""
    configuration: str = ""
    """Configuration object that it belongs to; empty when it belongs to the document."""
    plan: str = ""
    """ConfigMap with its plan."""


class Settled(Lenient):
    """What is known of the shards that have ended and are remembered as numbers only."""

    shards: int = 0
    """How many they are."""
    first: int = 0
    """How many of them are first attempts: the campaign's first ones."""
    repeated: int = 0
    """How many of them belong to the repetition that is under way: its first ones."""
    passed: int = 0
    """Their runs that passed."""
    failed: int = 0
    """Their runs that failed."""
    errored: int = 0
    """Their runs that errored."""
    not_needed: int = 0
    """Their runs that are not needed."""


class BadRuns(Lenient):
    """The failed and errored runs that the last index of the bucket names."""

    shards: int
    """How many shards that index covers."""
    total: int
    """How many runs it covers."""
    attempt: int
    """After which attempt it was made."""
    runs: int
    """How many are bad."""
    plan: str
    """ConfigMap with the plan."""
    list: str = ""
    """Name of the list in the bucket, `_transient/bad-runs-LIST.txt`; empty without one."""
    sizes: Annotated[str, AfterValidator(_check_sizes)] = ""
    """Sizes of the groups in which they are executed once more, `20x13,4x1`."""


class QueuePlace(Lenient):
    """Where a campaign that waits stands in its Kueue queue."""

    position: int
    """1 for the next one, of all that wait in the ClusterQueue."""
    pending: int
    """How many wait there, as far as this namespace's last one."""
    estimated_start: Time | None = None
    """When it will start, if those before it go on as so far; absent when that is not known."""
    summary: str = ""
    """`3 of 7, about 12 min`, for people."""


class Estimate(Lenient):
    """When a campaign ends, by its own pace; it changes with the numbers of runs only."""

    end: Time
    """When it ends."""
    earliest: Time
    """Nine of ten campaigns end between this time"""
    latest: Time
    """and this one."""
    cpu_hours: float | None = None
    """What its pods ask for until then [CPU-hours]; absent where the document limits no CPUs."""


class SearchStatus(Lenient):
    """How far a search is."""

    batch: int = 0
    """How many batches are scored."""
    evaluated: int = 0
    """How many parameter sets have a score."""
    best: str = ""
    """The best value so far, `failure_rate 0.97`."""
    criteria: str = ""
    """How far each criterion is, `batches 3/50 | failure_rate 0.97/0.9`."""
    stop: str = ""
    """What has ended the search: a criterion, `exhausted`, `errors` or `strategy`."""
    stop_reason: str = ""
    """Why, for people."""
    plan: str = ""
    """The ConfigMap with the plan that this is about."""


class CampaignStatus(Lenient):
    """What is known about a campaign."""

    observed_generation: int = 0
    """Generation that this status is about."""
    state: str = "Pending"
    """One word for people; programs read the conditions."""
    progress: str = ""
    """`912/1000`: runs with a result, of all that are needed."""
    campaign: str = ""
    """Name of the results folder."""
    bucket: str = ""
    """Bucket of the results."""
    endpoint: str = ""
    """URL of the S3 server as pods reach it."""
    image: str = ""
    """Container image of the runs."""
    attempt: int = 1
    """How often bad runs were executed, at most."""
    runs_per_configuration: int = 0
    """Planned runs of each configuration; `spec.runs` cannot be lower."""
    runs: Runs = Field(default_factory=Runs)
    """Numbers of runs."""
    failed_runs: Ranges = ""
    """Ids of failed runs as ranges, `17,204-206`."""
    errored_runs: Ranges = ""
    """Ids of errored runs as ranges."""
    ranges_truncated: bool = False
    """Whether ids are missing above; `_execution/index.json` in the bucket has them all."""
    failing: Annotated[list[str], Field(max_length=FAILING_LIMIT)] = Field(default_factory=list)
    """First bad runs by results folder."""
    shards: Annotated[list[Shard], Field(max_length=SHARDS_LIMIT)] = Field(default_factory=list)
    """The Jobs, the latest of them."""
    finished_shards: int = 0
    """How many shards the index in the bucket covers."""
    settled: Settled = Field(default_factory=Settled)
    """Shards that are remembered as numbers only."""
    bad: BadRuns | None = None
    """The bad runs that the index in the bucket names; `spec.attempt` repeats them."""
    search: SearchStatus | None = None
    """How far its search is, where the document has one."""
    decisions: Annotated[str, Field(max_length=DECISIONS_LIMIT)] = ""
    """What is decided about configurations, where `execution.runs` decides; at the end."""
    queue: QueuePlace | None = None
    """Its place in the queue, while all of it waits there."""
    estimate: Estimate | None = None
    """When it ends, while its runs are executed and one has ended."""
    start_time: Time | None = None
    """When the first Job was made, or had left its queue."""
    completion_time: Time | None = None
    """When the last run ended."""
    shared: str = ""
    """Which of the results a Job uploads to `spec.share`, or has."""
    notified: Annotated[list[str], Field(max_length=NOTIFIED_LIMIT)] = Field(default_factory=list)
    """What `spec.notifications` were told, the last of it."""
    conditions: Annotated[list[Condition], Field(max_length=16)] = Field(default_factory=list)
    """Facts that programs wait for."""


class ConfigurationStatus(Lenient):
    """What is known about a configuration."""

    observed_generation: int = 0
    """Generation that this status is about."""
    variants: int = 0
    """How many variants it expands to."""
    progress: str = ""
    """`18/20`: runs with a result, of all that are needed."""
    runs: Runs = Field(default_factory=Runs)
    """Numbers of runs."""
    conditions: Annotated[list[Condition], Field(max_length=16)] = Field(default_factory=list)
    """Facts that programs wait for."""


Status = TypeVar("Status", bound=Lenient)


def read_status(kind: type[Status], data: object) -> Status:
    """A status as it is in an object; fields that cannot be understood are left out.

    Others may have written it, or another version; what is left out is found out anew.
    """
    given: dict[str, Any] = dict(data) if isinstance(data, Mapping) else {}
    while True:
        try:
            return kind.model_validate(given)
        except ValidationError as error:
            wrong = {to_camel(str(problem["loc"][0])) for problem in error.errors()}
            given = {key: given[key] for key in given if to_camel(str(key)) not in wrong}


def compact(data: Any) -> Any:
    """Plain data without what is empty: an object that is read and kept often stays small."""
    if isinstance(data, list):
        return [compact(item) for item in data]
    if not isinstance(data, dict):
        return data
    kept = ((key, compact(value)) for key, value in data.items())
    return {key: value for key, value in kept if value not in ("", [], {})}

"""The section `execution`: how and where runs are executed, and how many."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    Tag,
    WithJsonSchema,
    field_validator,
    model_validator,
)
from pydantic_core import CoreSchema, PydanticCustomError

from robovast.base.containers import IMAGE
from robovast.base.sequential import SequentialTest
from robovast.model.document.assets import MOST_ASSETS, Assets, check_apart
from robovast.model.document.section import Pair, Section, merge_pairs
from robovast.model.packing import MOST
from robovast.model.quantities import EXTENDED_RESOURCE
from robovast.model.seeds import LARGEST_SEED

RESERVED_ENVIRONMENT = frozenset({"CAMPAIGN_ID", "POST_COMMAND", "PRE_COMMAND", "ROS_LOG_DIR"})
"""Scenario parameters that a document cannot set, because other keys determine them."""

CONTRACT_ENVIRONMENT = frozenset(
    {
        "AVAILABLE_CPUS",
        "AVAILABLE_MEM",
        "CONTAINER_NAME",
        "OUTPUT_DIR",
        "OUTPUT_RESULT_PER_SCENARIO",
        "ROBOVAST_CONFIG_DIR",
        "ROBOVAST_OUT_DIR",
        "ROBOVAST_SEED",
        "SCENARIO_EXECUTION_PARAMETERS",
        "SCENARIO_FILE",
        "SCENARIO_OUTPUT_DIR",
        "SCENARIO_PARAMETER_FILE",
        "SIMULATION",
    }
)
"""Variables of docs/reference/container-interface.md; the values of a document are ignored."""


Quantity = int | float | str
PerCluster = list[Pair]


class Resources(Section):
    """CPU, memory and GPU of a container; a list gives one value for each cluster context."""

    cpu: Annotated[int | float, Field(gt=0)] | str | PerCluster | None = None
    """Number of CPU cores, or a list of `context: value` pairs."""
    memory: Quantity | PerCluster | None = None
    """Memory limit such as `8Gi` or `4096Mi`, or a list of `context: value` pairs."""
    gpu: Annotated[int, Field(ge=0)] | PerCluster | None = None
    """Number of GPUs, or a list of `context: value` pairs."""


class MainResources(Resources):
    """Limits of the main container, and limits of all containers of a job together."""

    shm_size: Quantity | PerCluster | None = None
    """Size of `/dev/shm`, such as `1Gi` or `context: value` pairs (default: 64 MiB)."""


class SecondaryContainer(Section):
    """A container next to the main container, with the same network namespace and image."""

    name: str
    """The container's name."""
    resources: Resources = Field(default_factory=Resources)
    """Limits of the container."""


def _parse_secondary(value: Any) -> Any:
    if isinstance(value, SecondaryContainer):
        return value
    name, settings = value, None
    if isinstance(value, dict) and value:
        name = next((key for key in value if key != "resources"), "resources")
        settings, beside = value[name], {k: v for k, v in value.items() if k != name}
        settings = {**(settings or {}), **beside} if isinstance(settings, dict | None) else 0
    well_named = isinstance(name, str) and re.match(r"^[a-z0-9]([a-z0-9-]{0,40}[a-z0-9])?$", name)
    if not well_named or not isinstance(settings, dict | None):
        raise PydanticCustomError(
            "secondary_container",
            "must be a container's name (lower-case letters, digits, `-`), or one name with its "
            "`resources`",
        )
    return {**(settings or {}), "name": name}


class _SecondarySchema:
    """Schema of both forms: a name, or a name with its resources."""

    def __get_pydantic_json_schema__(
        self, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        del core_schema
        settings = {
            "type": ["object", "null"],
            "properties": {"resources": handler(Resources.__pydantic_core_schema__)},
            "additionalProperties": False,
        }
        beside = {"properties": settings["properties"], "additionalProperties": settings}
        return {"anyOf": [{"type": "string"}, {"type": "object", "minProperties": 1, **beside}]}


Secondary = Annotated[SecondaryContainer, BeforeValidator(_parse_secondary), _SecondarySchema()]


class Local(Section):
    """Settings of local runs only."""

    parameter_overrides: list[Pair] = Field(default_factory=list)
    """Scenario parameters that replace the values of variations, only in local runs."""


class Nodes(Section):
    """Scheduling of pods."""

    node_labels: dict[str, str] = Field(default_factory=dict)
    """Labels that a node must have."""


ClaimTemplate = Annotated[str, Field(pattern=r"^[a-z0-9][-a-z0-9.]{0,252}$")]


class Kubernetes(Section):
    """Settings of cluster runs only."""

    jobs: Nodes = Field(default_factory=Nodes)
    """The pods of runs."""
    control: Nodes = Field(default_factory=Nodes)
    """The pods that expand a campaign and process its results."""
    gpu_resource: Annotated[str, Field(pattern=EXTENDED_RESOURCE)] | PerCluster = "nvidia.com/gpu"
    """Resource of `gpu`, such as `amd.com/gpu`, or a list of `context: value` pairs."""
    ephemeral_storage: Quantity | PerCluster | None = None
    """Disk request and limit of a pod of runs (default: `agent.diskRequest`, `agent.diskLimit`)."""
    assets: Annotated[list[Assets], Field(max_length=MOST_ASSETS), AfterValidator(check_apart)] = (
        Field(default_factory=list)
    )
    """Volumes with files for all containers of a run."""
    device_claims: Annotated[list[ClaimTemplate], Field(max_length=8)] = Field(default_factory=list)
    """ResourceClaimTemplates of the namespace: devices that the containers of a run share."""


class Output(BaseModel):
    """Outputs of a run that a replay compares: `pattern`, or `pattern: tolerance`."""

    model_config = ConfigDict(frozen=True, defer_build=True)

    pattern: Annotated[str, Field(min_length=1)]
    """Glob pattern of paths in the run's folder; `BAG:/topic` compares the messages of a topic."""
    tolerance: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0
    """Largest difference of two numbers in a table."""

    @field_validator("pattern")
    @classmethod
    def _names_files(cls, value: str) -> str:
        files = value.partition(":/")[0]
        if files.strip("./ ") and value.isprintable() and not files.startswith("/"):
            return value
        raise PydanticCustomError(
            "output_pattern", "must be a glob pattern of files in the run's folder, as `out/*.csv`"
        )

    @property
    def files(self) -> str:
        """The pattern of the files."""
        return self.pattern.partition(":/")[0]

    @property
    def topic(self) -> str:
        """The topic of bags; empty when whole files are compared."""
        return "".join(self.pattern.partition(":/")[1:])[1:]


def _parse_output(value: Any) -> Any:
    if isinstance(value, str):
        return {"pattern": value}
    if isinstance(value, dict) and len(value) == 1:
        ((pattern, tolerance),) = value.items()
        if type(tolerance) in {int, float}:
            return {"pattern": pattern, "tolerance": tolerance}
        raise PydanticCustomError(
            "output_tolerance", "the tolerance of `{pattern}` is not a number", {"pattern": pattern}
        )
    raise PydanticCustomError("output", "must be a glob pattern, or one with its tolerance")


ComparedOutput = Annotated[
    Output,
    BeforeValidator(_parse_output),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "string", "minLength": 1},
                {
                    "type": "object",
                    "minProperties": 1,
                    "maxProperties": 1,
                    "additionalProperties": {"type": "number", "minimum": 0},
                },
            ]
        }
    ),
]


MOST_RUNS_OF_EACH = 100_000
"""Most runs of a configuration."""

Count = Annotated[int, Field(ge=1, le=MOST_RUNS_OF_EACH)]


class Decide(Section):
    """Failure rates that classify a configuration as passing or failing."""

    good: Annotated[float, Field(gt=0, lt=1)]
    """Failure rate up to which a configuration is passing."""
    bad: Annotated[float, Field(gt=0, lt=1)]
    """Failure rate from which on a configuration is failing."""
    error: Annotated[float, Field(gt=0, lt=0.5)] = 0.05
    """Probability of a wrong decision, for passing and for failing configurations."""

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if self.good >= self.bad:
            raise PydanticCustomError(
                "rates",
                "`good` must be less than `bad`, and {good} is not less than {bad}",
                {"good": self.good, "bad": self.bad},
            )
        return self


class RunsAsNeeded(Section):
    """Run each configuration until it is classified as passing or failing."""

    min: Count = 3
    """Minimum number of runs before a decision."""
    max: Count = 50
    """Maximum number of runs; then the configuration is inconclusive."""
    decide: Decide
    """Failure rates that classify a configuration as passing or failing."""

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if self.min > self.max:
            raise PydanticCustomError(
                "runs",
                "`min` must be at most `max`, and {min} is more than {max}",
                {"min": self.min, "max": self.max},
            )
        return self

    def test(self, most: int) -> SequentialTest:
        """The test that decides, after so many runs at most."""
        decide = self.decide
        return SequentialTest(decide.good, decide.bad, decide.error, min(self.min, most), most)


KINDS_OF_RUNS = ("a number of runs", "runs as needed")
"""What pydantic's locations of `execution.runs` end with."""


def _kind_of_runs(value: Any) -> str:
    return KINDS_OF_RUNS[isinstance(value, dict | RunsAsNeeded)]


AUTO = "auto"
"""`runs_per_job`: as many as measured run times suggest."""


def _is_no_word(value: Any) -> Any:
    if isinstance(value, str) and not value.strip().isdecimal():
        raise PydanticCustomError("runs_per_job", "must be a number of runs or `auto`")
    return value


KINDS_OF_PACKS = ("packs of a number of runs", "packs as measured")
"""What pydantic's locations of `execution.runs_per_job` end with."""


def _kind_of_packs(value: Any) -> str:
    return KINDS_OF_PACKS[value == AUTO]


RunsPerJob = Annotated[
    Annotated[int, Field(ge=1, le=MOST), BeforeValidator(_is_no_word), Tag(KINDS_OF_PACKS[0])]
    | Annotated[Literal["auto"], Tag(KINDS_OF_PACKS[1])],
    Discriminator(_kind_of_packs),
]


class Execution(Section):
    """How and where runs are executed."""

    image: Annotated[str, Field(pattern=IMAGE, max_length=500)] | None = None
    """Container image; the option `--image` and the variable `ROBOVAST_IMAGE` have priority."""
    runs: Annotated[
        Annotated[Count, Tag(KINDS_OF_RUNS[0])] | Annotated[RunsAsNeeded, Tag(KINDS_OF_RUNS[1])],
        Discriminator(_kind_of_runs),
    ] = 1
    """Number of runs of each configuration, or `min`, `max` and `decide`, which classify it."""
    runs_per_job: RunsPerJob = 1
    """Number of runs that share one job (one start of the simulator). `auto` uses measured times
    (docs/how-to/run-locally.md)."""
    seed: Annotated[int, Field(strict=True, ge=0, le=LARGEST_SEED)] | None = None
    """Seed of the campaign, from which the seeds of all runs are derived (default: random)."""
    timeout: Annotated[int, Field(ge=1)] | None = None
    """Maximum wall-clock time of one run in seconds (default: no limit)."""
    scenario_file: str | None = None
    """OpenSCENARIO 2 file, relative to the .vast file."""
    simulation: Annotated[str, Field(pattern=r"^[^\s:]+:[^\s:]+$")] | None = None
    """Simulation backend of scenario-execution, as `module:Class`."""
    run_as_user: Annotated[int, Field(ge=0)] = 1000
    """User id of the processes in the container; 0 is root."""
    pre_command: str | None = None
    """Script that is sourced before each run; a path in the container, without arguments."""
    post_command: str | None = None
    """Program that runs after each run; a path in the container, without arguments."""
    run_files: list[str] = Field(default_factory=list)
    """Glob patterns of files that the container needs, relative to the .vast file."""
    env: list[Pair] = Field(default_factory=list)
    """Environment variables of the container, one `NAME: value` pair an item."""
    resources: MainResources = Field(default_factory=MainResources)
    """Limits of the main container."""
    secondary_containers: list[Secondary] = Field(default_factory=list)
    """Containers next to the main container."""
    compare: list[ComparedOutput] | None = None
    """Outputs that `vast replay` compares, see docs/how-to/reproduce-a-failure.md (default: all CSV
    files)."""
    local: Local = Field(default_factory=Local)
    """Settings of local runs only."""
    kubernetes: Kubernetes = Field(default_factory=Kubernetes)
    """Settings of cluster runs only."""

    @property
    def most_runs(self) -> int:
        """How often each configuration is run at most."""
        return self.runs.max if isinstance(self.runs, RunsAsNeeded) else self.runs

    @property
    def packs_are_measured(self) -> bool:
        """Whether run times decide how many runs share a job.

        Where verdicts decide how many runs of a configuration there are, these share one anyway.
        """
        return self.runs_per_job == AUTO and not isinstance(self.runs, RunsAsNeeded)

    @property
    def runs_per_start(self) -> int:
        """How many runs a start executes at most, where nothing is measured."""
        if isinstance(self.runs_per_job, int):
            return self.runs_per_job
        return self.runs.max if isinstance(self.runs, RunsAsNeeded) else 1

    def test(self, most: int | None = None) -> SequentialTest | None:
        """The test that ends the runs of a configuration; None when their number is fixed.

        Args:
            most: replaces `max`.
        """
        return (
            self.runs.test(most or self.runs.max) if isinstance(self.runs, RunsAsNeeded) else None
        )

    @field_validator("pre_command", "post_command")
    @classmethod
    def _check_command(cls, value: str | None) -> str | None:
        if value is not None and (not value.strip() or len(value.split()) > 1):
            raise PydanticCustomError(
                "command", "must be the path of one executable file, without arguments"
            )
        return value

    @field_validator("env")
    @classmethod
    def _check_env(cls, pairs: list[dict[str, Any]]) -> list[dict[str, str]]:
        merged = merge_pairs(pairs)
        return [
            {name: _environment_value(name, value)}
            for name, value in merged.items()
            if name not in CONTRACT_ENVIRONMENT
        ]


def _environment_value(name: str, value: Any) -> str:
    if not re.match(r"^[A-Za-z_][A-Za-z0-9_]*$", name):
        raise PydanticCustomError(
            "env_name", "`{name}` is not a valid name of an environment variable", {"name": name}
        )
    if name in RESERVED_ENVIRONMENT:
        raise PydanticCustomError(
            "env_reserved", "`{name}` is set by RoboVAST itself and cannot be given", {"name": name}
        )
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str | int | float):
        return str(value)
    raise PydanticCustomError(
        "env_value", "the value of `{name}` must be text or a number", {"name": name}
    )

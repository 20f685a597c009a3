"""Every section and key of a .vast document, with its default.

The loader, the JSON schema, the `spec.vast` schema of the Campaign resource and the reference page
are all derived from these models, and all show the fields' descriptions.
"""

from __future__ import annotations

import json
import math
import re
from typing import Annotated, Any, Literal, Self

from pydantic import (
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

from robovast.base import docstrings
from robovast.base.sequential import SequentialTest
from robovast.model.quantities import EXTENDED_RESOURCE
from robovast.model.seeds import LARGEST_SEED

NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$"

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
"""Variables that the run contract sets (docs/run-contract.md); a document's values are ignored."""


class Section(BaseModel):
    """A mapping of known keys; a key without a value counts as absent."""

    model_config = ConfigDict(
        extra="forbid",
        use_attribute_docstrings=docstrings.READ,
        frozen=True,
        defer_build=True,
    )

    @model_validator(mode="before")
    @classmethod
    def _without_empty_keys(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        optional = {name for name, field in cls.model_fields.items() if not field.is_required()}
        return {key: v for key, v in value.items() if v is not None or key not in optional}


class PluginCall(BaseModel):
    """A plugin by name, with its parameters: `name` or `name: {parameter: value}`."""

    model_config = ConfigDict(frozen=True)

    name: str
    parameters: dict[str, Any] = Field(default_factory=dict)


def _parse_plugin_call(value: Any) -> Any:
    if isinstance(value, PluginCall):
        return value
    if isinstance(value, str):
        return PluginCall(name=value)
    if isinstance(value, dict) and len(value) == 1:
        ((name, parameters),) = value.items()
        if isinstance(name, str) and (parameters is None or isinstance(parameters, dict)):
            return PluginCall(name=name, parameters=parameters or {})
    if isinstance(value, dict) and len(value) > 1 and next(iter(value.values())) is None:
        raise PydanticCustomError(
            "plugin_indent",
            "the parameters of `{name}` must be indented further than its name",
            {"name": next(iter(value))},
        )
    raise PydanticCustomError(
        "plugin_call", "must be a plugin's name, or one name with a mapping of its parameters"
    )


def _parse_pair(value: Any) -> Any:
    if isinstance(value, dict) and value and all(isinstance(name, str) for name in value):
        return value
    raise PydanticCustomError("pair", "must be a `name: value` pair")


Plugin = Annotated[
    PluginCall,
    BeforeValidator(_parse_plugin_call),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "string"},
                {
                    "type": "object",
                    "minProperties": 1,
                    "maxProperties": 1,
                    "additionalProperties": {"type": ["object", "null"]},
                },
            ]
        }
    ),
]

Pair = Annotated[
    dict[str, Any],
    BeforeValidator(_parse_pair),
    WithJsonSchema({"type": "object", "minProperties": 1}),
]


def merge_pairs(pairs: list[dict[str, Any]]) -> dict[str, Any]:
    """Merge `name: value` pairs into a mapping; the last value of a repeated name wins."""
    return {name: value for pair in pairs for name, value in pair.items()}


class Design(Section):
    """Which combinations of the variations' values are made, rather than all."""

    kind: Literal["full", "pairwise", "sobol", "lhs", "random"]
    """`full`: all; `pairwise`: few in which any two values of different variations meet; `sobol`,
    `lhs` (Latin hypercube): spread evenly; `random`: drawn at random."""
    count: Annotated[int, Field(ge=1)] | None = None
    """Number of combinations of `sobol`, `lhs` and `random`."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of `sobol`, `lhs` and `random`."""

    @model_validator(mode="after")
    def _check_count(self) -> Design:
        counts = self.kind not in {"full", "pairwise"}
        if counts and self.count is None:
            raise PydanticCustomError(
                "design_count",
                "the key `count` is missing: the number of combinations of a design `{kind}`",
                {"kind": self.kind},
            )
        if not counts and self.model_fields_set & {"count", "seed"}:
            raise PydanticCustomError(
                "design_count",
                "a design `{kind}` follows from the values: leave out `count` and `seed`",
                {"kind": self.kind},
            )
        return self


class ConfigurationEntry(Section):
    """A named set of runs: fixed parameters, or variations of them."""

    name: str
    """Unique name; the results folders begin with it."""
    scenario_file: str | None = None
    """Older place of `execution.scenario_file`; must be the same in every entry."""
    parameters: list[Pair] | None = None
    """Fixed parameter values, one `name: value` pair an item; variations may replace them."""
    variations: list[Plugin] | None = None
    """Variations in order; each multiplies the configurations of the one before."""
    design: Design | None = None
    """Which combinations of the variations' values are made; all when omitted."""

    @field_validator("name")
    @classmethod
    def _check_name(cls, value: str) -> str:
        if not re.match(NAME_PATTERN, value) or value.endswith("."):
            raise PydanticCustomError(
                "configuration_name",
                "`{name}` cannot name a folder: use letters, digits, `-`, `_` and `.`, beginning "
                "with a letter or digit, at most 100",
                {"name": value},
            )
        return value


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
    """Limits of the main container, and what all containers of a job share."""

    shm_size: Quantity | PerCluster | None = None
    """Size of `/dev/shm`, such as `1Gi` (64 MiB when omitted), or `context: value` pairs."""


class SecondaryContainer(Section):
    """A container beside the main one, in the same network namespace, with the same image."""

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
    """Scenario parameters that replace what the variations made, in local runs only."""


class Nodes(Section):
    """Where pods may be scheduled."""

    node_labels: dict[str, str] = Field(default_factory=dict)
    """Labels that a node must have, all of them."""


class Kubernetes(Section):
    """Settings of cluster runs only."""

    jobs: Nodes = Field(default_factory=Nodes)
    """The pods that execute runs."""
    control: Nodes = Field(default_factory=Nodes)
    """The pods that compose a campaign and process its results."""
    gpu_resource: Annotated[str, Field(pattern=EXTENDED_RESOURCE)] | PerCluster = "nvidia.com/gpu"
    """What `gpu` counts, such as `amd.com/gpu`, or a list of `context: value` pairs."""
    ephemeral_storage: Quantity | PerCluster | None = None
    """Disk that a pod of runs asks for and may fill; as the installation says when omitted."""


class Output(BaseModel):
    """Outputs of a run that a replay compares: `pattern`, or `pattern: tolerance`."""

    model_config = ConfigDict(frozen=True)

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
            "output_tolerance", "the tolerance of `{pattern}` is no number", {"pattern": pattern}
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
    """Between which failure rates is decided."""

    good: Annotated[float, Field(gt=0, lt=1)]
    """Failure rate up to which a configuration is sound."""
    bad: Annotated[float, Field(gt=0, lt=1)]
    """Failure rate from which on it is broken."""
    error: Annotated[float, Field(gt=0, lt=0.5)] = 0.05
    """Probability of a wrong decision, for a sound configuration as for a broken one."""

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
    """As many runs of each configuration as it takes to call it sound or broken."""

    min: Count = 3
    """Runs before which nothing is decided."""
    max: Count = 50
    """Runs after which a configuration stays undecided."""
    decide: Decide
    """Between which failure rates is decided."""

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


class Execution(Section):
    """How and where runs are executed."""

    image: str | None = None
    """Container image; the `--image` option and `ROBOVAST_IMAGE` come before it."""
    runs: Annotated[
        Annotated[Count, Tag(KINDS_OF_RUNS[0])] | Annotated[RunsAsNeeded, Tag(KINDS_OF_RUNS[1])],
        Discriminator(_kind_of_runs),
    ] = 1
    """How often each configuration is run; or `min`, `max` and `decide`: as often as it takes."""
    runs_per_job: Annotated[int, Field(ge=1, le=10_000)] = 1
    """How many runs share one job (one simulator set-up)."""
    seed: Annotated[int, Field(strict=True, ge=0, le=LARGEST_SEED)] | None = None
    """Seed of the campaign, from which each run's own follows; drawn at random when omitted."""
    timeout: Annotated[int, Field(ge=1)] | None = None
    """Longest wall-clock time of one run [s]; no limit when omitted."""
    scenario_file: str | None = None
    """OpenSCENARIO 2 file, relative to the .vast file."""
    simulation: Annotated[str, Field(pattern=r"^[^\s:]+:[^\s:]+$")] | None = None
    """Simulation backend of scenario-execution, as `module:Class`."""
    run_as_user: Annotated[int, Field(ge=0)] = 1000
    """User id of the processes in the container; 0 is root."""
    pre_command: str | None = None
    """Script that is sourced before each run; a path in the container, without arguments."""
    post_command: str | None = None
    """Program that is executed after each run; a path in the container, without arguments."""
    run_files: list[str] = Field(default_factory=list)
    """Glob patterns of files that the container needs, relative to the .vast file."""
    env: list[Pair] = Field(default_factory=list)
    """Environment variables of the container, one `NAME: value` pair an item."""
    resources: MainResources = Field(default_factory=MainResources)
    """Limits of the main container."""
    secondary_containers: list[Secondary] = Field(default_factory=list)
    """Containers that run beside the main one."""
    compare: list[ComparedOutput] | None = None
    """Outputs that `vast replay` compares (docs/confidence.md); all CSV files when omitted."""
    local: Local = Field(default_factory=Local)
    """Settings of local runs only."""
    kubernetes: Kubernetes = Field(default_factory=Kubernetes)
    """Settings of cluster runs only."""

    @property
    def most_runs(self) -> int:
        """How often each configuration is run at most."""
        return self.runs.max if isinstance(self.runs, RunsAsNeeded) else self.runs

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
            "env_name", "`{name}` is no name of an environment variable", {"name": name}
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


class SearchDimension(Section):
    """One dimension of a search space."""

    type: Literal["float", "int", "choice", "bool"]
    """Kind of the values."""
    low: int | float | None = None
    """Least number."""
    high: int | float | None = None
    """Largest number; it belongs to the dimension."""
    log: bool = False
    """Sample numbers on a logarithmic scale; `low` must be above 0."""
    step: Annotated[int, Field(ge=1)] | None = None
    """Distance between neighbouring integers, counted from `low`."""
    values: list[Any] | None = None
    """Values of a choice."""

    @model_validator(mode="after")
    def _check_domain(self) -> SearchDimension:
        allowed = _KEYS_OF_DIMENSIONS[self.type]
        extra = sorted(self.model_fields_set - {"type"} - allowed)
        if extra:
            known = ", ".join(f"`{key}`" for key in sorted(allowed)) or "no keys"
            raise _domain_error(f"`{extra[0]}` has no meaning here: `{self.type}` has {known}")
        if self.type in {"float", "int"}:
            self._check_numbers()
        if self.type == "choice":
            self._check_values()
        return self

    def _check_numbers(self) -> None:
        if self.low is None or self.high is None or not self.low <= self.high:
            raise _domain_error("a number needs `low` and `high`, with `low` at most `high`")
        if not (math.isfinite(self.low) and math.isfinite(self.high)):
            raise _domain_error("`low` and `high` must be finite numbers")
        if self.log and self.low <= 0:
            raise _domain_error("a logarithmic scale needs `low` above 0")
        if self.type == "int" and not (
            float(self.low).is_integer() and float(self.high).is_integer()
        ):
            raise _domain_error("`low` and `high` of an `int` must be whole numbers")

    def _check_values(self) -> None:
        if not self.values:
            raise _domain_error("a choice needs `values`")
        texts = [json.dumps(value, sort_keys=True, default=str) for value in self.values]
        for index, text in enumerate(texts):
            if text in texts[:index]:
                raise _domain_error(f"the value {text} stands twice")


_KEYS_OF_DIMENSIONS = {
    "float": {"low", "high", "log"},
    "int": {"low", "high", "log", "step"},
    "choice": {"values"},
    "bool": set(),
}


def _domain_error(message: str) -> PydanticCustomError:
    return PydanticCustomError("search_domain", "{message}", {"message": message})


class SearchObjective(Section):
    """A value that a search optimizes."""

    name: str
    """The objective's name in the result of the extract step."""
    direction: Literal["maximize", "minimize"] = "maximize"
    """Direction of the optimization."""


SearchAggregate = Literal["min", "max", "mean", "median", "sum", "first", "last"]


class SearchMetric(Section):
    """A number about a configuration: of a column, or of a query."""

    table: str | None = None
    """Name of a CSV file of each run, without `.csv`."""
    column: str | None = None
    """A column of the table."""
    over_time: SearchAggregate | None = None
    """What a run's rows come to."""
    over_runs: SearchAggregate = "mean"
    """What the runs of a configuration come to."""
    sql: str | None = None
    """A query whose rows are the name of a configuration and its number; in place of the others."""

    @model_validator(mode="after")
    def _check_kind(self) -> Self:
        column = {"table", "column", "over_time"}
        given = self.model_fields_set
        if given != {"sql"} and not (column <= given and "sql" not in given):
            raise PydanticCustomError(
                "search_metric", "needs `table`, `column` and `over_time`, or `sql` alone"
            )
        return self


class SearchExtract(Section):
    """The step that turns a configuration's results into objectives and measures."""

    plugin: str = "failure_rate"
    """Name or file reference of the plugin."""
    params: dict[str, Any] = Field(default_factory=dict)
    """Its parameters."""
    metrics: dict[str, SearchMetric] = Field(default_factory=dict)
    """Numbers by name, in place of a plugin; `failure_rate` is always among them."""

    @model_validator(mode="after")
    def _check_one(self) -> Self:
        if self.metrics and self.model_fields_set & {"plugin", "params"}:
            raise PydanticCustomError(
                "search_extract", "`metrics` and `plugin` cannot stand together"
            )
        return self

    @property
    def call(self) -> tuple[str, dict[str, Any]]:
        """The extractor's name and parameters."""
        if not self.metrics:
            return self.plugin, self.params
        return "metrics", {n: m.model_dump(exclude_unset=True) for n, m in self.metrics.items()}


def _shorthand(field: str, kinds: type | tuple[type, ...]) -> BeforeValidator:
    """A scalar that stands for a mapping's main field."""

    def parse(value: Any) -> Any:
        return {field: value} if isinstance(value, kinds) and value is not True else value

    return BeforeValidator(parse)


class _OrScalar:
    """Schema of a mapping that a scalar may stand for."""

    def __init__(self, kind: str) -> None:
        self._kind = kind

    def __get_pydantic_json_schema__(
        self, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"anyOf": [{"type": self._kind}, handler(core_schema)]}


class BatchBudget(Section):
    """A number of batches."""

    value: Annotated[int, Field(ge=1)]
    """Most batches."""


class TimeBudget(Section):
    """A time."""

    seconds: Annotated[float, Field(gt=0)]
    """Longest time from the beginning of the search [s]; a batch under way is finished."""


class TargetObjective(Section):
    """A value of the objective."""

    value: float
    """The search ends when the best set reaches it."""


class NoImprovement(Section):
    """A number of batches without improvement."""

    patience: Annotated[int, Field(ge=1)]
    """Batches to wait for an improvement."""
    min_delta: Annotated[float, Field(ge=0)] = 0.0
    """Least difference that counts as one."""


class MetricReached(Section):
    """A limit of a number in the strategy's report."""

    name: str
    """Name of the number, such as `coverage`."""
    op: Literal[">=", "<=", ">", "<"] = ">="
    """Comparison with the value."""
    value: float
    """The limit."""


_NUMBER = (int, float)


class _Criterion(Section):
    """One of several keys."""

    @model_validator(mode="after")
    def _exactly_one(self) -> Self:
        if len(self.model_fields_set) != 1:
            names = ", ".join(f"`{name}`" for name in type(self).model_fields)
            raise PydanticCustomError(
                "search_criterion", "must be one of {names}, with its value", {"names": names}
            )
        return self


class BudgetItem(_Criterion):
    """A limit of what a search may spend: one of the keys."""

    batches: Annotated[BatchBudget, _shorthand("value", int), _OrScalar("integer")] | None = None
    """Most batches."""
    time: Annotated[TimeBudget, _shorthand("seconds", _NUMBER), _OrScalar("number")] | None = None
    """Longest time from the beginning [s]; a batch under way is finished."""


class StoppingItem(_Criterion):
    """A result that ends a search: one of the keys."""

    target_objective: (
        Annotated[TargetObjective, _shorthand("value", _NUMBER), _OrScalar("number")] | None
    ) = None
    """A value of the objective that the best set reaches."""
    no_improvement: (
        Annotated[NoImprovement, _shorthand("patience", int), _OrScalar("integer")] | None
    ) = None
    """Batches without a better set: `{patience, min_delta}`, or the patience."""
    metric: MetricReached | None = None
    """A number in the strategy's report: `{name, op, value}`."""


SETS_LIMIT = 10_000
"""Most parameter sets of a batch."""


class Search(Section):
    """Closed-loop search in place of a fixed list of configurations."""

    strategy: str
    """`random`, `boundary`, `optuna`, `qd`, the name of an entry point, or a file reference."""
    search_space: Annotated[dict[str, SearchDimension], Field(min_length=1)]
    """Typed dimensions by name."""
    postprocessing: list[Plugin] = Field(default_factory=list)
    """Plugins that run over each batch before it is scored."""
    extract: SearchExtract = Field(default_factory=SearchExtract)
    """The scoring step; the rate of failed runs when omitted."""
    objectives: Annotated[list[SearchObjective], Field(min_length=1)]
    """What to optimize."""
    per_batch: Annotated[int, Field(ge=1, le=SETS_LIMIT)] = 1
    """Parameter sets proposed for each batch."""
    budget: list[BudgetItem] = Field(default_factory=list)
    """Limits of what the search may spend; the first that is reached ends it."""
    stopping: list[StoppingItem] = Field(default_factory=list)
    """Results that end the search; the first that is reached does."""
    max_errors: Annotated[int, Field(ge=0)] = 10
    """Most parameter sets that may be left out because they could not be evaluated."""
    seed: Annotated[
        int,
        BeforeValidator(lambda seed: 0 if seed is None else seed),
        WithJsonSchema({"anyOf": [{"type": "integer"}, {"type": "null"}]}),
    ] = 0
    """Seed of the strategy; `null` is 0, so that every search can be continued."""
    strategy_parameters: dict[str, Any] = Field(default_factory=dict)
    """Parameters of the strategy, checked by it."""
    variations: list[Plugin] | None = None
    """Template of variations; `$name` stands for the value of a dimension."""
    parameters: list[Pair] | None = None
    """Fixed parameters beside the searched ones; `$name` stands for the value of a dimension."""

    @field_validator("objectives")
    @classmethod
    def _check_objectives(cls, objectives: list[SearchObjective]) -> list[SearchObjective]:
        names = [objective.name for objective in objectives]
        for name in names:
            if names.count(name) > 1:
                raise PydanticCustomError(
                    "search_objectives", "the objective `{name}` stands twice", {"name": name}
                )
        return objectives

    @model_validator(mode="after")
    def _must_end(self) -> Search:
        if not self.budget and not self.stopping:
            raise PydanticCustomError(
                "search_end",
                "a search needs a `budget` or a `stopping` criterion, to come to an end",
            )
        return self


class ResultsProcessing(Section):
    """Processing of the results after the runs."""

    postprocessing: list[Plugin] = Field(default_factory=list)
    """Commands that turn raw output into tables."""
    publication: list[Plugin] = Field(default_factory=list)
    """Plugins that package or distribute the results."""
    metadata_processing: list[Plugin] = Field(default_factory=list)
    """Plugins that complete metadata.yaml."""


class Notebooks(Section):
    """Notebooks of one workload, by the scope that they analyze."""

    run: str | None = None
    """Notebook for a single run."""
    config: str | None = None
    """Notebook for all runs of a configuration."""
    batch: str | None = None
    """Notebook for one batch of a search."""
    campaign: str | None = None
    """Notebook for a whole campaign."""


def _known_notebooks(value: Any) -> Any:
    """Workloads without empty items, and without workloads that have no notebooks."""
    if not isinstance(value, list):
        return value
    items = [item for item in value if item is not None]
    return [
        {name: {} if notebooks is None else notebooks for name, notebooks in item.items()}
        if isinstance(item, dict)
        else item
        for item in items
    ]


Workloads = Annotated[list[dict[str, Notebooks]], BeforeValidator(_known_notebooks)]


class Player(Section):
    """What the player of a run reads; what is omitted is guessed by type and name."""

    bag: str | None = None
    """Path suffix of the bag's folder in the run, as `rosbag2`."""
    pose: str | None = None
    """Topic of the robot's pose: odometry, a pose (with covariance or without), or `/tf`."""
    scan: str | None = None
    """Topic of the laser (`sensor_msgs/msg/LaserScan`)."""
    plan: str | None = None
    """Topic of the planned path (`nav_msgs/msg/Path`)."""
    map: str | None = None
    """Topic of the map (`nav_msgs/msg/OccupancyGrid`), shown where the configuration has none."""
    footprint: str | None = None
    """Topic of the footprint (`geometry_msgs/msg/PolygonStamped`)."""
    tree: str | None = None
    """Topic of the behaviour tree (py_trees_ros or Nav2's log of it)."""
    log: str | None = None
    """Topic of log messages (`rcl_interfaces/msg/Log`)."""


class Evaluation(Section):
    """Presentation of the results."""

    player: Player = Field(default_factory=Player)
    """Topics of the player in a run's page."""

    visualization: Workloads = Field(default_factory=list)
    """Workloads by name; each is a tab of the page."""


class Analysis(Section):
    """Older spelling of `results_processing.postprocessing` and `evaluation.visualization`."""

    postprocessing: list[Plugin] = Field(default_factory=list)
    """Commands that turn raw output into tables."""
    visualization: Workloads = Field(default_factory=list)
    """Workloads by name; each is a tab of the page."""


class Vast(Section):
    """A .vast document."""

    version: Literal[1]
    """Version of the format."""
    metadata: dict[str, Any] = Field(default_factory=dict)
    """Free description; `name` names the campaign, other keys describe the dataset."""
    general: dict[str, Any] = Field(default_factory=dict)
    """Passed to every variation type as its `general_parameters`."""
    configuration: list[ConfigurationEntry] | None = None
    """The configurations to run."""
    execution: Execution = Field(default_factory=Execution)
    """How and where runs are executed."""
    search: Search | None = None
    """Closed-loop search in place of `configuration`."""
    results_processing: ResultsProcessing = Field(default_factory=ResultsProcessing)
    """Processing of the results after the runs."""
    evaluation: Evaluation = Field(default_factory=Evaluation)
    """Presentation of the results."""
    analysis: Analysis = Field(default_factory=Analysis)
    """Older spelling of `results_processing.postprocessing` and `evaluation.visualization`."""

    @model_validator(mode="after")
    def _check_whole(self) -> Vast:
        if self.search is not None and self.configuration:
            raise PydanticCustomError(
                "search_and_configuration", "`search` and `configuration` cannot stand together"
            )
        return self

    @property
    def scenario_file(self) -> str | None:
        """The scenario, from `execution` or, in older files, from the entries."""
        if self.execution.scenario_file:
            return self.execution.scenario_file
        return next((e.scenario_file for e in self.configuration or [] if e.scenario_file), None)

    @property
    def postprocessing(self) -> list[PluginCall]:
        """Postprocessing commands, under either spelling."""
        return [*self.results_processing.postprocessing, *self.analysis.postprocessing]

    @property
    def visualization(self) -> dict[str, Notebooks]:
        """Notebook workloads by name, under either spelling."""
        workloads = [*self.evaluation.visualization, *self.analysis.visualization]
        return {name: notebooks for item in workloads for name, notebooks in item.items()}

    @property
    def campaign_name(self) -> str:
        """`metadata.name`, or `campaign`."""
        return str(self.metadata.get("name") or "campaign")

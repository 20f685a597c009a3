"""The section `search`, with its space, its extraction and its criteria."""

from __future__ import annotations

import json
import math
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BeforeValidator,
    Field,
    GetJsonSchemaHandler,
    WithJsonSchema,
    field_validator,
    model_validator,
)
from pydantic_core import CoreSchema, PydanticCustomError

from robovast.model.document.section import Pair, Plugin, Section
from robovast.model.packs import SETS_LIMIT


class SearchDimension(Section):
    """One dimension of a search space."""

    type: Literal["float", "int", "choice", "bool"]
    """Type of the values."""
    low: int | float | None = None
    """Minimum."""
    high: int | float | None = None
    """Maximum (inclusive)."""
    log: bool = False
    """Sample numbers on a logarithmic scale; `low` must be above 0."""
    step: Annotated[int, Field(ge=1)] | None = None
    """Distance between adjacent integers, starting at `low`."""
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
        if not math.isfinite(self.high - self.low):
            raise _domain_error("`low` and `high` are too far apart for a floating point number")
        if self.log and self.low <= 0:
            raise _domain_error("a logarithmic scale needs `low` above 0")
        if self.type == "int" and not (
            float(self.low).is_integer() and float(self.high).is_integer()
        ):
            raise _domain_error("`low` and `high` of an `int` must be whole numbers")

    def _check_values(self) -> None:
        if not self.values:
            raise _domain_error("a choice needs `values`")
        for value in self.values:
            if not _is_json(value):
                raise _domain_error(
                    f"the value {value!r:.80} cannot be stored: give texts, finite numbers, "
                    "`true`, `false`, `null`, lists and mappings of texts"
                )
        texts = [json.dumps(value, sort_keys=True) for value in self.values]
        for index, text in enumerate(texts):
            if text in texts[:index]:
                raise _domain_error(f"the value {text} occurs twice")


def _is_json(value: Any) -> bool:
    """Whether a value is the same after it was stored as JSON."""
    try:
        return bool(json.loads(json.dumps(value, allow_nan=False)) == value)
    except (TypeError, ValueError):
        return False


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
    """Function that combines the rows of a run."""
    over_runs: SearchAggregate = "mean"
    """Function that combines the runs of a configuration."""
    sql: str | None = None
    """A query that returns configurations and their numbers, in place of the other keys."""

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
            raise PydanticCustomError("search_extract", "`metrics` and `plugin` exclude each other")
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
    """Maximum number of batches."""


class TimeBudget(Section):
    """A time."""

    seconds: Annotated[float, Field(gt=0)]
    """Maximum time since the start in seconds. A running batch is finished."""


class TargetObjective(Section):
    """A value of the objective."""

    value: float
    """The search ends when the best set reaches it."""


class NoImprovement(Section):
    """A number of batches without improvement."""

    patience: Annotated[int, Field(ge=1)]
    """Batches to wait for an improvement."""
    min_delta: Annotated[float, Field(ge=0)] = 0.0
    """Minimum difference that counts as an improvement."""


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
    """A limit of the search: one of the keys."""

    batches: Annotated[BatchBudget, _shorthand("value", int), _OrScalar("integer")] | None = None
    """Maximum number of batches."""
    time: Annotated[TimeBudget, _shorthand("seconds", _NUMBER), _OrScalar("number")] | None = None
    """Maximum time since the start. A running batch is finished."""


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


class Search(Section):
    """Closed-loop search in place of a fixed list of configurations."""

    strategy: str
    """`random`, `boundary`, `optuna`, `qd`, the name of an entry point, or a file reference."""
    search_space: Annotated[dict[str, SearchDimension], Field(min_length=1)]
    """Typed dimensions by name."""
    postprocessing: list[Plugin] = Field(default_factory=list)
    """Plugins that run over each batch before it is scored."""
    extract: SearchExtract = Field(default_factory=SearchExtract)
    """The scoring step (default: the rate of failed runs)."""
    objectives: Annotated[list[SearchObjective], Field(min_length=1)]
    """The values to optimize."""
    per_batch: Annotated[int, Field(ge=1, le=SETS_LIMIT)] = 1
    """Parameter sets proposed for each batch."""
    budget: list[BudgetItem] = Field(default_factory=list)
    """Limits of the search. The search ends when it reaches the first limit."""
    stopping: list[StoppingItem] = Field(default_factory=list)
    """Results that end the search. The first result that is reached ends it."""
    max_errors: Annotated[int, Field(ge=0)] = 10
    """Maximum number of parameter sets that are skipped because they cannot be evaluated."""
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
    """Fixed parameters; `$name` stands for the value of a dimension."""

    @field_validator("objectives")
    @classmethod
    def _check_objectives(cls, objectives: list[SearchObjective]) -> list[SearchObjective]:
        names = [objective.name for objective in objectives]
        for name in names:
            if names.count(name) > 1:
                raise PydanticCustomError(
                    "search_objectives", "the objective `{name}` occurs twice", {"name": name}
                )
        return objectives

    @model_validator(mode="after")
    def _must_end(self) -> Search:
        if not self.budget and not self.stopping:
            raise PydanticCustomError(
                "search_end",
                "a search needs a `budget` or a `stopping` criterion",
            )
        return self

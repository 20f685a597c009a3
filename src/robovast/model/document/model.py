"""Every section and key of a .vast document, with its default.

The loader, the JSON schema, the `spec.vast` schema of the Campaign resource and the reference page
are all derived from these models, and all show the fields' descriptions.
"""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from robovast.model.document.execution import Execution
from robovast.model.document.search.section import Search
from robovast.model.document.section import Pair, Plugin, PluginCall, Section
from robovast.model.naming import OWN_FILES

NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$"


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
                "a design `{kind}` depends only on the values: remove `count` and `seed`",
                {"kind": self.kind},
            )
        return self


class ConfigurationEntry(Section):
    """A named set of runs: fixed parameters, or variations of them."""

    name: str
    """Unique name; the names of the results folders start with this name."""
    scenario_file: str | None = None
    """Older place of `execution.scenario_file`; must be the same in every entry."""
    parameters: list[Pair] | None = None
    """Fixed parameter values, one `name: value` pair an item; variations may replace them."""
    variations: list[Plugin] | None = None
    """Variations in order. Each one multiplies the configurations of the previous one."""
    design: Design | None = None
    """Combinations of the variations' values (default: all)."""

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
        if value in OWN_FILES:
            raise PydanticCustomError(
                "configuration_name",
                "`{name}` is a file of the campaign itself: choose another name",
                {"name": value},
            )
        return value


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
    """Topics of the playback of a run (default: detected by type and name)."""

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
    camera: str | None = None
    """Topic of the camera (`sensor_msgs/msg/CompressedImage`: JPEG, PNG or WebP)."""
    tree: str | None = None
    """Topic of the behavior tree (py_trees_ros or Nav2's log of it)."""
    log: str | None = None
    """Topic of log messages (`rcl_interfaces/msg/Log`)."""


class EvaluationSection(Section):
    """Presentation of the results."""

    player: Player = Field(default_factory=Player)
    """Topics of the playback in a run's page."""

    visualization: Workloads = Field(default_factory=list)
    """Workloads by name. Each workload is a tab in the web UI."""


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
    """Description. `name` is the name of the campaign, other keys describe the dataset."""
    general: dict[str, Any] = Field(default_factory=dict)
    """Passed to every variation type as its `general_parameters`."""
    configuration: list[ConfigurationEntry] | None = None
    """The configurations to run."""
    execution: Execution = Field(default_factory=Execution)
    """Settings of the runs."""
    search: Search | None = None
    """Closed-loop search in place of `configuration`."""
    results_processing: ResultsProcessing = Field(default_factory=ResultsProcessing)
    """Processing of the results after the runs."""
    evaluation: EvaluationSection = Field(default_factory=EvaluationSection)
    """Presentation of the results."""
    analysis: Analysis = Field(default_factory=Analysis)
    """Older spelling of `results_processing.postprocessing` and `evaluation.visualization`."""

    @field_validator("search")
    @classmethod
    def _check_alone(cls, search: Search | None, info: ValidationInfo) -> Search | None:
        if search is not None and info.data.get("configuration"):
            raise PydanticCustomError(
                "search_and_configuration",
                "`search` and `configuration` exclude each other, because a search creates its "
                "own configurations; remove one of them",
            )
        return search

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

"""Obstacles near the robot's path, present from the beginning or when the robot comes near."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import BaseModel, Field, field_validator, model_validator

from robovast.base.optional_deps import NAV
from robovast.model.variations import Factor
from robovast.navigation.base import (
    RECORD,
    Config,
    NavigationConfig,
    NavigationVariation,
    Pointer,
    Reference,
    RobotDiameter,
    as_list,
    with_record,
)
from robovast.navigation.poses import Pose, length_of, position, read_pose
from robovast.navigation.sizes import radius_of

if TYPE_CHECKING:
    from robovast.navigation.costmap import Costmap
    from robovast.navigation.obstacle_placement import Course, ObstacleKind, Placed

NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Several = NotNegative | Annotated[list[NotNegative], Field(min_length=1)]


class ObstacleKindConfig(NavigationConfig):
    """Obstacles of one kind."""

    amount: Annotated[int, Field(ge=0)] | None = None
    """Number of obstacles; give either this or `amount_per_m`."""
    amount_per_m: Several | None = None
    """Number of obstacles per length of the path [1/m]; a list multiplies."""
    max_distance: Several | None = None
    """Largest distance from the path [m]; by default anywhere on the map. A list multiplies."""
    model: str
    """Model of the obstacle, passed from the scenario to the simulator."""
    xacro_arguments: str = ""
    """Arguments of the model, such as `width:=0.5, length:=0.5`, which also determine its size."""

    @model_validator(mode="after")
    def _check_amount(self) -> ObstacleKindConfig:
        if (self.amount is None) == (self.amount_per_m is None):
            raise ValueError("set either `amount` or `amount_per_m`")
        return self

    @field_validator("xacro_arguments")
    @classmethod
    def _check_size(cls, value: str) -> str:
        radius_of(value)
        return value


class ObstacleVariationConfig(NavigationConfig):
    """Parameters of ObstacleVariation."""

    name: str
    """Scenario parameter for the list of obstacles."""
    obstacle_configs: list[ObstacleKindConfig]
    """Kinds of obstacles."""
    seed: int | None = None
    """Seed; by default derived from the configuration's name."""
    robot_diameter: RobotDiameter = 0.35
    """Width of a robot for which there is still a path [m]."""
    map_file: str | None = None
    """Map, or the parameter with it; by default the map of the previous variation."""
    count: Annotated[int, Field(ge=1)] = 1
    """Number of placements for each combination of the lists."""


class ObstacleVariationWithDistanceTriggerConfig(ObstacleVariationConfig):
    """Parameters of ObstacleVariationWithDistanceTrigger."""

    spawn_trigger_point: Reference
    """Parameter for the position of the first obstacle."""
    spawn_trigger_threshold: Reference
    """Parameter for the distance from there at which obstacles appear [m]."""
    trigger_distance: Several
    """That distance [m]; a list multiplies."""
    start_pose: Pointer | None = None
    """Start of the path, or the parameter with it; by default that of a previous path variation."""
    goal_pose: Pointer | None = None
    """Goal of the path, or the parameter with it."""
    goal_poses: Pointer | list[Pointer] | None = None
    """Older spelling of `goal_pose`; only the first of several goals counts."""

    @property
    def goal(self) -> Pointer | None:
        """The goal, under either spelling."""
        older = self.goal_poses[:1] if isinstance(self.goal_poses, list) else [self.goal_poses]
        return self.goal_pose if self.goal_pose is not None else next(iter(older), None)


class ObstacleVariation(NavigationVariation):
    """Places obstacles randomly near the path."""

    CONFIG_CLASS: ClassVar[type[BaseModel] | None] = ObstacleVariationConfig

    def variation(self, in_configs: list[Config]) -> list[Config]:
        """Each configuration with each placement of obstacles."""
        made = []
        with NAV.needed_by(type(self).__name__):
            from robovast.navigation.obstacle_placement import PlacingError
            from robovast.navigation.paths import NoPathError

            for config in in_configs:
                try:
                    made += list(self._generate(config))
                except (NoPathError, PlacingError) as error:
                    raise self.error(config, error) from None
        return made

    def _generate(self, config: Config) -> Iterator[Config]:
        from robovast.navigation.obstacle_placement import place

        costmap = self.costmap(config, self.parameters.map_file, self.parameters.robot_diameter)
        for skip in self._skips():
            course = self._course(config, costmap, skip)
            for choice in itertools.product(*map(_choices, self.parameters.obstacle_configs)):
                kinds = [self._kind(config, course, *one) for one in choice]
                for number in range(self.parameters.count):
                    rng = self.generator(self.parameters.seed, skip, _identity(choice), number)
                    placed = place(costmap, rng, course, kinds)
                    factors = {**_factors(choice), **self._trigger_factors(skip)}
                    factors["placement"] = str(number + 1)
                    yield self._with_obstacles(config, course, kinds, placed, factors)

    def _skips(self) -> list[float]:
        """Lengths of the path's beginning without obstacles [m], one for each combination."""
        return [0.0]

    def _course(self, config: Config, costmap: Costmap, skip: float) -> Course:
        """The path of a previous variation; empty if there is none."""
        from robovast.navigation.obstacle_placement import Course

        del costmap
        record = config.get(RECORD, {})
        if "path" not in record:
            return Course((), (), skip)
        stops = [read_pose(pose).point for pose in (record["start"], *record["goals"])]
        return Course(tuple(map(tuple, record["path"])), tuple(stops), skip)

    def _kind(
        self,
        config: Config,
        course: Course,
        settings: ObstacleKindConfig,
        amount_per_m: float | None,
        max_distance: float | None,
    ) -> ObstacleKind:
        from robovast.navigation.obstacle_placement import ObstacleKind

        if not course.points and (amount_per_m is not None or max_distance is not None):
            raise self.error(
                config,
                "`amount_per_m` and `max_distance` need a path: put a path variation before.",
            )
        length = length_of(list(course.points))
        amount = (
            settings.amount if amount_per_m is None else math.floor(amount_per_m * length + 1e-9)
        )
        return ObstacleKind(amount or 0, radius_of(settings.xacro_arguments), max_distance)

    def _with_obstacles(
        self,
        config: Config,
        course: Course,
        kinds: list[ObstacleKind],
        placed: list[Placed],
        factors: Factors,
    ) -> Config:
        owners = [index for index, kind in enumerate(kinds) for _ in range(kind.amount)]
        settings = [self.parameters.obstacle_configs[index] for index in owners]
        obstacles = [
            {
                "entity_name": f"obstacle_{number}",
                "model": kind.model,
                "spawn_pose": one.pose.parameter(),
                "xacro_arguments": kind.xacro_arguments,
            }
            for number, (kind, one) in enumerate(zip(settings, placed, strict=True))
        ]
        shapes = [
            {"x": round(one.pose.x, 4), "y": round(one.pose.y, 4), "radius": one.kind.radius}
            for one in placed
        ]
        record = {
            "robot_diameter": self.parameters.robot_diameter,
            "map_file": self.map_name(config, self.parameters.map_file),
            "obstacles": shapes,
        }
        values = {
            self.parameters.name.removeprefix("@"): obstacles,
            **self._trigger(course, placed),
        }
        others = with_record(config, **record)
        return self.update_config(config, values, other_values=others, factors=factors)

    def _trigger_factors(self, skip: float) -> Factors:
        del skip
        return {}

    def _trigger(self, course: Course, placed: list[Placed]) -> dict[str, Any]:
        del course, placed
        return {}


class ObstacleVariationWithDistanceTrigger(ObstacleVariation):
    """Places obstacles that appear when the robot comes near them."""

    CONFIG_CLASS = ObstacleVariationWithDistanceTriggerConfig

    def _skips(self) -> list[float]:
        # An obstacle nearer to the start would be there from the beginning.
        return as_list(self.parameters.trigger_distance)

    def _course(self, config: Config, costmap: Costmap, skip: float) -> Course:
        """The path between the given poses, or that of a previous variation."""
        from robovast.navigation.obstacle_placement import Course
        from robovast.navigation.paths import Wish, measured_path, require_passable

        start = self._pose(config, self.parameters.start_pose)
        goal = self._pose(config, self.parameters.goal)
        if start is None or goal is None:
            course = super()._course(config, costmap, skip)
            if not course.points:
                raise self.error(
                    config,
                    "there is no path: give `start_pose` and `goal_pose`, or put a path variation "
                    "before.",
                )
            return course
        require_passable(costmap, Wish(0.0, 0.0, start=start, fixed_goals=(goal,)))
        path = measured_path(costmap, start, (goal,))
        return Course(path.points, (start.point, goal.point), skip)

    def _trigger_factors(self, skip: float) -> Factors:
        return {"trigger_distance": Factor(skip, "m")}

    def _pose(self, config: Config, pointer: Pointer | None) -> Pose | None:
        return None if pointer is None else self.given_pose(config, pointer)

    def _trigger(self, course: Course, placed: list[Placed]) -> dict[str, Any]:
        point_name = self.parameters.spawn_trigger_point.removeprefix("@")
        threshold_name = self.parameters.spawn_trigger_threshold.removeprefix("@")
        if not placed:
            return {threshold_name: course.skip}
        point = placed[0].pose.point
        is_pose = (self.type_of(point_name) or "").startswith("pose")
        value = Pose(*point).parameter() if is_pose else position(point)
        return {point_name: value, threshold_name: course.skip}


Factors = dict[str, Factor | str]
Choice = tuple[ObstacleKindConfig, float | None, float | None]


def _choices(settings: ObstacleKindConfig) -> list[Choice]:
    """All combinations of the lists of one kind."""
    amounts = [None] if settings.amount_per_m is None else as_list(settings.amount_per_m)
    distances = [None] if settings.max_distance is None else as_list(settings.max_distance)
    return [(settings, *pair) for pair in itertools.product(amounts, distances)]


def _factors(choice: tuple[Choice, ...]) -> Factors:
    """What was varied of the obstacles; names of several kinds end with the kind's model."""
    found: Factors = {}
    for kind, amount_per_m, distance in choice:
        model = PurePosixPath(kind.model).name.partition(".")[0]
        suffix = f"_{model}" if len(choice) > 1 else ""
        for name, factor in _of_kind(kind, amount_per_m, distance):
            found[f"{name}{suffix}"] = factor
    return found


def _of_kind(
    kind: ObstacleKindConfig, amount_per_m: float | None, distance: float | None
) -> Iterator[tuple[str, Factor]]:
    if amount_per_m is not None:
        yield "clutter", Factor(amount_per_m, "1/m")
    if kind.amount is not None:
        yield "number_of_obstacles", Factor(kind.amount)
    if distance is not None:
        yield "obstacle_distance", Factor(distance, "m")


def _identity(choice: tuple[Choice, ...]) -> list[tuple[Any, ...]]:
    """Identity of a combination, for its seed."""
    return [(kind.model, kind.amount, *lists) for kind, *lists in choice]

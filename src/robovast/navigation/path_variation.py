"""Path variations: start and goal poses at given path lengths, drawn randomly or on a raster."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, model_validator

from robovast.base.optional_deps import NAV
from robovast.model.variation_config import get_validated_config
from robovast.model.variations import Factor
from robovast.navigation.base import (
    Config,
    NavigationConfig,
    NavigationVariation,
    Pointer,
    Reference,
    RobotDiameter,
    as_list,
    with_record,
)
from robovast.navigation.poses import Pose, read_pose

if TYPE_CHECKING:
    from robovast.navigation.costmap import Costmap
    from robovast.navigation.paths import Path, Wish

Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]


Factors = dict[str, Factor | int | str]


class _PathConfig(NavigationConfig):
    map_file: str | None = None
    """Map, or the parameter with it; by default the map of a previous variation."""
    path_length: Length | Annotated[list[Length], Field(min_length=1)]
    """Length of the path from the start through all goals [m]; a list multiplies."""
    path_length_tolerance: Length = 0.5
    """Largest deviation from the length [m]."""
    robot_diameter: RobotDiameter = 0.35
    """Diameter of the robot; the path keeps half of it from every obstacle [m]."""


class PathVariationRandomConfig(_PathConfig):
    """Parameters of PathVariationRandom."""

    start_pose: Pointer
    """Parameter for the start, or with an existing one; or a fixed `{x, y, yaw}`."""
    goal_poses: Reference | Annotated[list[Pointer], Field(min_length=1)] | None = None
    """Parameter for the goals (for the first one, unless it is a list), or fixed poses."""
    num_goal_poses: Annotated[int, Field(ge=1)] | None = None
    """Number of goals; by default 1, unless `num_goal_poses_per_m` is given."""
    num_goal_poses_per_m: Length | Annotated[list[Length], Field(min_length=1)] | None = None
    """Number of goals per length of the path, at least 1 [1/m]; a list multiplies."""
    num_paths: Annotated[int, Field(ge=1)] = 1
    """Number of paths of each length."""
    min_distance: Annotated[float, Field(ge=0)] = 0.0
    """Least straight-line distance between any two poses of a path [m]."""
    seed: int | None = None
    """Seed; by default derived from the configuration's name."""

    @model_validator(mode="after")
    def _check_goals(self) -> PathVariationRandomConfig:
        if self.num_goal_poses is not None and self.num_goal_poses_per_m is not None:
            raise ValueError("give `num_goal_poses` or `num_goal_poses_per_m`, not both")
        return self

    def goals(self, length: float) -> Iterator[int]:
        """Numbers of goals of paths of a length [m], one for each `num_goal_poses_per_m`."""
        if self.num_goal_poses_per_m is None:
            yield self.num_goal_poses or 1
            return
        for per_m in as_list(self.num_goal_poses_per_m):
            yield max(1, round(length * per_m))


class PathVariationRasterizedConfig(_PathConfig):
    """Parameters of PathVariationRasterized."""

    start_pose: Pointer | None = None
    """Parameter that gets the start; with a pose (its own, or a fixed one) only that one starts."""
    goal_poses: Reference | None = None
    """Parameter that gets the goals; without, `goal_pose` for one and `goal_poses` for several."""
    num_goal_poses: Annotated[int, Field(ge=1)] = 1
    """Number of goals."""
    raster_size: Length
    """Distance of the raster's points [m]."""
    raster_offset_x: float = 0.0
    """Where the raster begins, from the map's origin [m]."""
    raster_offset_y: float = 0.0
    """Where the raster begins, from the map's origin [m]."""


class _PathVariation(NavigationVariation):
    def variation(self, in_configs: list[Config]) -> list[Config]:
        """Each configuration with each path."""
        with NAV.needed_by(type(self).__name__):
            from robovast.navigation.paths import NoPathError
        made = []
        for config in in_configs:
            costmap = self.costmap(config, self.parameters.map_file, self.parameters.robot_diameter)
            try:
                for path, factors in self._paths(config, costmap):
                    made.append(self._with_path(config, path, factors))
            except NoPathError as error:
                map_name = self.map_name(config, self.parameters.map_file)
                raise self.error(config, f"{map_name}: {error}") from None
        return made

    def _paths(self, config: Config, costmap: Costmap) -> Iterator[tuple[Path, Factors]]:
        """The paths, each with what was varied."""
        raise NotImplementedError

    def _goals_parameter_name(self) -> str:
        """The parameter for the goals: the one that is named, else the scenario's own."""
        named = self.reference(self.parameters.goal_poses)
        if named is not None:
            return named
        own = ["goal_pose", "goal_poses"]
        if self.parameters.num_goal_poses not in (None, 1) or not self.has_parameter(own[0]):
            own.reverse()
        return next(filter(self.has_parameter, own), own[0])

    def _with_path(self, config: Config, path: Path, factors: Factors) -> Config:
        values: dict[str, Any] = {}
        start = self.reference(self.parameters.start_pose)
        if start is not None:
            values[start] = path.start.parameter()
        if not isinstance(self.parameters.goal_poses, list):
            name = self._goals_parameter_name()
            values[name] = self._goals_parameter(name, path)
        record = {
            "map_file": self.map_name(config, self.parameters.map_file),
            "robot_diameter": self.parameters.robot_diameter,
            "start": path.start.parameter(),
            "goals": [goal.parameter() for goal in path.goals],
            "path": [[round(x, 4), round(y, 4)] for x, y in path.points],
            "path_length": round(path.length, 4),
        }
        others = with_record(config, **record)
        return self.update_config(config, values, other_values=others, factors=factors)

    def _goals_parameter(self, name: str, path: Path) -> Any:
        poses = [goal.parameter() for goal in path.goals]
        declared = self.type_of(name)
        is_list = name != "goal_pose" if declared is None else declared.startswith("list")
        if not is_list and len(poses) > 1:
            self.warn_once(
                f"the parameter `{name}` holds one pose, not {len(poses)}: it gets the first goal "
                "of each path. Declare it as `list of pose_3d`, or ask for one goal."
            )
        return poses if is_list else poses[0]


class PathVariationRandom(_PathVariation):
    """Draws random paths."""

    CONFIG_CLASS = PathVariationRandomConfig

    @classmethod
    def most_of_each(cls, parameters: Any, base_path: str) -> int | None:
        """The number of requested paths."""
        del base_path
        return get_validated_config(parameters, PathVariationRandomConfig).num_paths

    def _paths(self, config: Config, costmap: Costmap) -> Iterator[tuple[Path, Factors]]:
        from robovast.navigation.paths import draw_path

        lengths = as_list(self.parameters.path_length)
        by_length = [list(self.parameters.goals(length)) for length in lengths]
        for goals in zip(*by_length, strict=True):
            for length, count in zip(lengths, goals, strict=True):
                for number in range(self.parameters.num_paths):
                    rng = self.generator(self.parameters.seed, length, number)
                    factors = {**_length(length), "goals": count, "path": str(number + 1)}
                    yield draw_path(costmap, rng, self._wish(config, length, count)), factors

    def _wish(self, config: Config, length: float, goals: int) -> Wish:
        from robovast.navigation.paths import Wish

        return Wish(
            length,
            self.parameters.path_length_tolerance,
            self.parameters.min_distance,
            goals,
            self.given_pose(config, self.parameters.start_pose),
            self._fixed_goals(config),
        )

    def _fixed_goals(self, config: Config) -> tuple[Pose, ...] | None:
        goals = self.parameters.goal_poses
        if not isinstance(goals, list):
            return None
        try:
            return tuple(read_pose(self.given(config, goal)) for goal in goals)
        except ValueError as error:
            raise self.error(config, error) from None


class PathVariationRasterized(_PathVariation):
    """Finds all paths of a given length between points of a raster."""

    CONFIG_CLASS = PathVariationRasterizedConfig

    def _paths(self, config: Config, costmap: Costmap) -> Iterator[tuple[Path, Factors]]:
        from robovast.navigation.paths import Wish
        from robovast.navigation.raster import Raster, raster_paths

        offset = (self.parameters.raster_offset_x, self.parameters.raster_offset_y)
        raster = Raster(self.parameters.raster_size, offset)
        named = self.parameters.start_pose
        start = None if named is None else self.given_pose(config, named)
        for length in as_list(self.parameters.path_length):
            wish = Wish(
                length,
                self.parameters.path_length_tolerance,
                goals=self.parameters.num_goal_poses,
                start=start,
            )
            for number, path in enumerate(raster_paths(costmap, raster, wish), 1):
                yield path, {**_length(length), "path": str(number)}


def _length(length: float) -> Factors:
    return {"path_length": Factor(length, "m")}

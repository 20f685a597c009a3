"""The base class of navigation variations: references, maps, errors."""

from __future__ import annotations

import hashlib
import logging
import random
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import ConfigDict, Field

from robovast.base.errors import InputError, RobovastError
from robovast.model.scenario import read_scenario, scenario_defaults
from robovast.model.variation_config import VariationConfig
from robovast.model.variations import ProvContribution, Variation
from robovast.navigation.poses import Pose, read_pose
from robovast.navigation.provenance import METADATA_KEY, counts

if TYPE_CHECKING:
    from robovast.navigation.costmap import Costmap

_log = logging.getLogger(__name__)

Config = dict[str, Any]

RECORD = "_navigation"
"""Key of a configuration for records used by other variations, pictures and provenance."""

RobotDiameter = Annotated[float, Field(gt=0, le=100)]
Reference = Annotated[str, Field(pattern=r"^@?[A-Za-z_]\w*$")]
"""Name of a scenario parameter, optionally preceded by `@`."""
Pointer = Reference | dict[str, Any]
"""A pose, or the parameter that contains or receives it."""
FloatOrList = float | list[float]


class NavigationConfig(VariationConfig):
    """Base of the parameter models of this package; unknown parameters are errors."""

    model_config = ConfigDict(extra="forbid")


def as_list(value: FloatOrList) -> list[float]:
    """A number or several numbers as a list."""
    return value if isinstance(value, list) else [value]


class NavigationVariation(Variation):
    """Base of the variations of this package.

    None of them is pure: they read users' maps and models, make files for runs, and take seconds.
    They are therefore applied once, in a Job, instead of in the operator and again in each pod.
    """

    pure = False

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._maps: set[Path] = set()
        self._warned: set[str] = set()

    def error(self, config: Config, message: object) -> InputError:
        """An error that names the configuration."""
        hint = message.hint if isinstance(message, RobovastError) else ""
        text = message.message if isinstance(message, RobovastError) else message
        where = f"configuration `{config['name']}`: {type(self).__name__}"
        return InputError(f"{where}: {text}", hint=hint)

    def reference(self, value: Any) -> str | None:
        """The scenario parameter that a text refers to; None if the value is not text."""
        return value.removeprefix("@") if isinstance(value, str) else None

    def warn_once(self, message: str) -> None:
        """Show a warning to the user; equal warnings are shown once."""
        if message not in self._warned:
            self._warned.add(message)
            _log.warning("%s: %s", type(self).__name__, message)

    def has_parameter(self, name: str) -> bool:
        """Whether the scenario has a parameter."""
        return name in self._types

    def type_of(self, name: str) -> str | None:
        """The declared type of a scenario parameter; None if it does not exist."""
        return self._types.get(name)

    @cached_property
    def _types(self) -> dict[str, str]:
        """Declared types of the scenario's parameters."""
        return {p.name: p.type for p in read_scenario(self.scenario_file).parameters}

    def given(self, config: Config, value: Any) -> Any:
        """The value itself, or the configuration's value of the parameter that it refers to.

        None if the parameter has no value yet.
        """
        name = self.reference(value)
        return value if name is None else config["config"].get(name)

    def given_pose(self, config: Config, value: Any) -> Pose | None:
        """The pose that is given directly or by reference.

        Raises:
            InputError: the value is not a pose.
        """
        found = self.given(config, value)
        try:
            return None if found is None else read_pose(found)
        except ValueError as error:
            raise self.error(config, error) from None

    def costmap(self, config: Config, map_file: str | None, robot_diameter: float) -> Costmap:
        """The costmap of a configuration's map.

        Raises:
            InputError: there is no map, or it cannot be read.
        """
        from robovast.navigation.costmap import read_costmap

        name = self.map_name(config, map_file).removeprefix("/config/")
        made = {str(relative): source for relative, source in config.get("_config_files", ())}
        path = Path(made.get(name, Path(self.base_path) / name))
        if name not in made:
            self._maps.add(path)
        try:
            return read_costmap(path, robot_diameter)
        except InputError as error:
            raise self.error(config, error) from None

    def map_name(self, config: Config, map_file: str | None) -> str:
        """The map's name, given by the parameter or by the floor plan that made it.

        A text that is a parameter's name, with or without `@`, refers to the parameter; other
        texts are paths. The default is a previous variation's map, then the configuration's own.
        """
        values = config["config"]
        if map_file is None:
            name = config.get(RECORD, {}).get("map_file") or values.get("map_file")
        elif map_file.startswith("@") or self.has_parameter(map_file):
            parameter = map_file.removeprefix("@")
            name = values.get(parameter) or self._defaults.get(parameter)
        else:
            name = map_file
        if not isinstance(name, str) or not name:
            raise self.error(
                config,
                "there is no map. Name one with `map_file: maps/hall.yaml` or "
                '`map_file: "@map_file"`, or put a floor plan variation before.',
            )
        return name

    @cached_property
    def _defaults(self) -> dict[str, Any]:
        """Default values of the scenario's parameters."""
        return scenario_defaults(self.scenario_file)

    def get_input_files(self) -> list[str]:
        """The maps that were read, except those made by a variation, and their images."""
        from robovast.navigation.occupancy import map_image

        return [str(file) for path in sorted(self._maps) for file in (path, map_image(path))]

    @classmethod
    def collect_config_metadata(
        cls, config_entry: dict[str, Any], config_dir: Path, campaign_dir: Path
    ) -> dict[str, Any]:
        """Records of the navigation variations for the configuration."""
        del config_dir, campaign_dir
        record = config_entry.get(RECORD)
        return {METADATA_KEY: record} if record else {}

    @classmethod
    def collect_prov_metadata(
        cls,
        config_entry: dict[str, Any],
        campaign_namespace: Any,
        config_namespace: Any,
        gen_activity_id: str,
        vast_id: str,
    ) -> ProvContribution | None:
        """The number of goals and obstacles."""
        del campaign_namespace, config_namespace, gen_activity_id, vast_id
        return counts(config_entry)

    def generator(self, seed: int | None, *identity: object) -> random.Random:
        """A random generator for one draw; equal seeds and identities give equal numbers."""
        if seed is None:
            identity = (self.entry, type(self).__name__, *identity)
        text = repr((seed, *identity))
        digest = hashlib.sha256(text.encode()).digest()
        return random.Random(int.from_bytes(digest[:8]))  # noqa: S311  # repeatable on purpose


def with_record(config: Config, **values: Any) -> dict[str, Any]:
    """`other_values` that extend the records of previous variations."""
    return {RECORD: {**config.get(RECORD, {}), **values}}

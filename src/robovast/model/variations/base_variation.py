"""The base class of variation types."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from pydantic import BaseModel

from robovast.model.scenario import scenario_defaults
from robovast.model.variation_config import get_validated_config
from robovast.model.variations.factors import Factor, Scalar, note_factors

ConfigFiles = Sequence[tuple[str, str]]
"""Pairs of a name relative to the config folder and an absolute path."""


@dataclass
class ProvContribution:
    """A variation's additions to a campaign's provenance graph."""

    graph_nodes: list[dict[Any, Any]] = field(default_factory=list)
    """JSON-LD nodes for the `@graph`."""
    scenario_properties: dict[Any, Any] = field(default_factory=dict)
    """Properties of the configuration's concrete scenario."""
    run_used_iris: list[Any] = field(default_factory=list)
    """IRIs that every run of the configuration uses, in the provenance graph."""


@dataclass(frozen=True)
class Given:
    """A value that a variation gives to a scenario parameter, or one of its kind."""

    path: tuple[str | int, ...]
    """Its place in the variation's parameters."""
    name: str
    value: Any
    remedy: str = ""
    """What to change there, if the value does not stand there."""


class Variation:
    """Base class of variation types, which make configurations from configurations.

    A configuration is a dict with `name`, `config` (scenario parameters), `_config_files` (pairs of
    a relative name and an absolute path) and any other keys.

    Attributes:
        base_path: folder of the .vast file.
        parameters: an instance of CONFIG_CLASS, or the mapping as written if there is none.
        general_parameters: the document's section `general`.
        scenario_file: path of the scenario.
        output_dir: folder for generated files.
        container_runner: starts the container of `get_required_container`; None if there is none.
        entry: name of the configuration entry that is expanded.
    """

    entry: str = ""

    pure: ClassVar[bool] = False
    """Whether the type is pure: it runs no user code, starts no container and reads no file but the
    scenario. The operator expands pure types itself, without a Job. Subclasses do not inherit this.
    """
    CONFIG_CLASS: ClassVar[type[BaseModel] | None] = None
    """Model of the parameters."""
    CACHE_ID: ClassVar[str | None] = None
    """Version of the type's results, for types that cache them."""
    GUI_CLASS: ClassVar[Any] = None
    GUI_RENDERER_CLASS: ClassVar[Any] = None

    def __init__(
        self,
        base_path: str,
        parameters: Any,
        general_parameters: Any,
        progress_update_callback: Callable[[str], None] | None,
        scenario_file: str,
        output_dir: str | None,
        container_runner: Any = None,
    ) -> None:
        self.base_path = base_path
        self.parameters: Any = (
            get_validated_config(parameters, self.CONFIG_CLASS)
            if self.CONFIG_CLASS is not None
            else parameters
        )
        self.general_parameters = general_parameters
        self.progress_update_callback = progress_update_callback
        self.scenario_file = scenario_file
        self.output_dir = output_dir
        self.container_runner = container_runner
        self._children: Counter[str] = Counter()

    def variation(self, in_configs: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """The configurations that this variation makes from the given ones."""
        raise NotImplementedError(f"{type(self).__name__} does not implement `variation`")

    @classmethod
    def is_pure(cls, parameters: Any) -> bool:
        """Whether the type is pure with these parameters.

        Args:
            parameters: the parameters as written.
        """
        del parameters
        return bool(vars(cls).get("pure", False))

    @classmethod
    def most_of_each(cls, parameters: Any, base_path: str) -> int | None:
        """Most configurations made from each given one; None if only making them can tell.

        Documents with too many configurations are refused before any is made.

        Args:
            parameters: the parameters as written.
            base_path: folder of the .vast file.
        """
        del parameters, base_path
        return None

    @classmethod
    def levels(cls, parameters: Any, base_path: str) -> int | None:
        """Number of values, each of which makes one configuration of each given one, in one order.

        Designs choose among them. None means that a design cannot: values are drawn, or depend on
        the given configuration.

        Args:
            parameters: the parameters as written.
            base_path: folder of the .vast file.
        """
        del parameters, base_path
        return None

    @classmethod
    def given_values(cls, parameters: Any, types: Mapping[str, str]) -> Iterable[Given]:
        """Values for scenario parameters, as far as they are known before anything is expanded.

        Args:
            parameters: valid ones.
            types: declared types of the scenario's parameters.
        """
        del parameters, types
        return ()

    def update_config(
        self,
        config: dict[str, Any],
        scenario_values: dict[str, Any] | None,
        config_files: ConfigFiles | None = None,
        other_values: dict[str, Any] | None = None,
        factors: Mapping[str, Factor | Scalar] | None = None,
    ) -> dict[str, Any]:
        """A copy of a configuration with additional values.

        Args:
            config: the parent, which is not changed.
            scenario_values: scenario parameters to set.
            config_files: additional files of the configuration.
            other_values: additional keys of the configuration.
            factors: what a person varied, if it is not `scenario_values` themselves but they
                follow from it; a name that is taken gets a number.

        Returns:
            The copy; its name is the parent's followed by the number of this child, from 1.
        """
        name = config["name"]
        self._children[name] += 1
        child: dict[str, Any] = _copy(config)
        child["name"] = f"{name}-{self._children[name]}"
        note_factors(child, scenario_values or {}, factors)
        child.setdefault("config", {}).update(_copy(scenario_values or {}))
        child.setdefault("_config_files", []).extend(config_files or ())
        child.update(_copy(other_values or {}))
        return child

    def progress_update(self, msg: str) -> None:
        """Show the user a progress message."""
        if self.progress_update_callback is not None:
            self.progress_update_callback(f"{type(self).__name__}: {msg}")

    def get_cache_input_files(self, in_configs: list[dict[str, Any]]) -> list[str]:
        """Files that determine the result."""
        del in_configs
        return []

    def get_input_files(self) -> list[str]:
        """Files to copy into the campaign's `_config` folder, relative to `base_path`."""
        return []

    def get_campaign_transient_files(self) -> list[tuple[str, str]]:
        """Pairs of a relative name and an absolute path, for the campaign's `_transient` folder."""
        return []

    def check_scenario_parameter_reference(self, reference_name: str) -> None:
        """Check that the scenario has a parameter.

        Raises:
            ValueError: the scenario lacks the parameter.
        """
        known = scenario_defaults(self.scenario_file)
        if reference_name not in known:
            raise ValueError(
                f"{type(self).__name__}: the scenario {self.scenario_file} has no parameter "
                f"`{reference_name}`; it has {', '.join(known) or 'none'}"
            )

    @classmethod
    def get_required_container(cls, parameters: Any) -> Any:
        """The container that the variation needs, or None."""
        del parameters

    @classmethod
    def collect_config_metadata(
        cls, config_entry: dict[str, Any], config_dir: Path, campaign_dir: Path
    ) -> dict[str, Any]:
        """Additions to a configuration's entry in metadata.yaml."""
        del config_entry, config_dir, campaign_dir
        return {}

    @classmethod
    def collect_prov_metadata(
        cls,
        config_entry: dict[str, Any],
        campaign_namespace: Any,
        config_namespace: Any,
        gen_activity_id: str,
        vast_id: str,
    ) -> ProvContribution | None:
        """Additions to the provenance graph, or None."""
        del config_entry, campaign_namespace, config_namespace, gen_activity_id, vast_id
        return None


_SHARED = (str, int, float, bool, type(None))


def _copy(value: Any) -> Any:
    """A deep copy of containers; immutable values are shared.

    It is three times as fast as copy.deepcopy, and is called for every configuration.
    """
    kind = type(value)
    if kind in _SHARED:
        return value
    if kind is dict:
        return {key: item if type(item) in _SHARED else _copy(item) for key, item in value.items()}
    if kind is list:
        return [item if type(item) in _SHARED else _copy(item) for item in value]
    if kind is tuple:
        return tuple(map(_copy, value))
    from copy import deepcopy

    return deepcopy(value)

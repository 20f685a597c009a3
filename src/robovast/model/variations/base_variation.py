"""The base class of variation types."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from pydantic import BaseModel

from robovast.model.scenario import scenario_defaults
from robovast.model.variation_config import get_validated_config

ConfigFiles = Sequence[tuple[str, str]]
"""Pairs of a name relative to the config folder and an absolute path."""


@dataclass
class ProvContribution:
    """What a variation adds to the provenance graph of a campaign."""

    graph_nodes: list[dict[Any, Any]] = field(default_factory=list)
    """JSON-LD nodes for the `@graph`."""
    scenario_properties: dict[Any, Any] = field(default_factory=dict)
    """Properties of the configuration's concrete scenario."""
    run_used_iris: list[Any] = field(default_factory=list)
    """What every run of the configuration declares as `prov:used`."""


class Variation:
    """Makes configurations of configurations.

    A configuration is a dict with `name`, `config` (scenario parameters), `_config_files` (pairs of
    a relative name and an absolute path) and any other keys.

    Attributes:
        base_path: folder of the .vast file.
        parameters: an instance of CONFIG_CLASS when there is one, else the mapping as written.
        general_parameters: the section `general` of the document.
        scenario_file: path of the scenario.
        output_dir: folder for generated files.
        container_runner: starts the container that `get_required_container` names, or None.
        entry: name of the configuration entry that is expanded.
    """

    entry: str = ""

    pure: ClassVar[bool] = False
    """Whether the type only computes: it runs no code of users, starts no container and reads no
    file but the scenario. Such types are expanded by the operator itself, without a Job.

    It holds for the class that says it, and for none that inherits from it."""
    CONFIG_CLASS: ClassVar[type[BaseModel] | None] = None
    """Model of the parameters."""
    CACHE_ID: ClassVar[str | None] = None
    """Version of the results, for types that cache what they make."""
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
        """The configurations that this variation makes of others."""
        raise NotImplementedError(f"{type(self).__name__} does not implement `variation`")

    @classmethod
    def is_pure(cls, parameters: Any) -> bool:
        """Whether the type only computes, with these parameters.

        Args:
            parameters: as written.
        """
        del parameters
        return bool(vars(cls).get("pure", False))

    @classmethod
    def most_of_each(cls, parameters: Any, base_path: str) -> int | None:
        """How many configurations it makes of each at most; None when only making them tells.

        A document with too many is refused before anything is made.

        Args:
            parameters: as written.
            base_path: folder of the .vast file.
        """
        del parameters, base_path
        return None

    def update_config(
        self,
        config: dict[str, Any],
        scenario_values: dict[str, Any] | None,
        config_files: ConfigFiles | None = None,
        other_values: dict[str, Any] | None = None,
    ) -> dict[str, Any]:
        """A copy of a configuration with further values.

        Args:
            config: the parent; it and its other children stay as they are.
            scenario_values: scenario parameters to set.
            config_files: further files of the configuration.
            other_values: further keys of the configuration.

        Returns:
            The copy; its name is the parent's with the number of this child, from 1.
        """
        name = config["name"]
        self._children[name] += 1
        child: dict[str, Any] = _copy(config)
        child["name"] = f"{name}-{self._children[name]}"
        child.setdefault("config", {}).update(_copy(scenario_values or {}))
        child.setdefault("_config_files", []).extend(config_files or ())
        child.update(_copy(other_values or {}))
        return child

    def progress_update(self, msg: str) -> None:
        """Tell the user what goes on."""
        if self.progress_update_callback is not None:
            self.progress_update_callback(f"{type(self).__name__}: {msg}")

    def get_cache_input_files(self, in_configs: list[dict[str, Any]]) -> list[str]:
        """Files that decide the result."""
        del in_configs
        return []

    def get_input_files(self) -> list[str]:
        """Files to copy into the campaign's `_config` folder, relative to `base_path`."""
        return []

    def get_campaign_transient_files(self) -> list[tuple[str, str]]:
        """Pairs of a relative name and an absolute path, for the campaign's `_transient` folder."""
        return []

    def check_scenario_parameter_reference(self, reference_name: str) -> None:
        """Make sure that the scenario has a parameter.

        Raises:
            ValueError: it has not.
        """
        known = scenario_defaults(self.scenario_file)
        if reference_name not in known:
            raise ValueError(
                f"{type(self).__name__}: the scenario {self.scenario_file} has no parameter "
                f"`{reference_name}`; it has {', '.join(known) or 'none'}"
            )

    @classmethod
    def get_required_container(cls, parameters: Any) -> Any:
        """The container that the variation needs, None when it needs none."""
        del parameters

    @classmethod
    def collect_config_metadata(
        cls, config_entry: dict[str, Any], config_dir: Path, campaign_dir: Path
    ) -> dict[str, Any]:
        """What to add to a configuration's entry in metadata.yaml."""
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
        """What to add to the provenance graph, None when nothing."""
        del config_entry, campaign_namespace, config_namespace, gen_activity_id, vast_id
        return None


_SHARED = (str, int, float, bool, type(None))


def _copy(value: Any) -> Any:
    """A deep copy of containers; what cannot be changed is shared.

    Three times as fast as copy.deepcopy, and called once per configuration.
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

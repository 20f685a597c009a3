"""Alternatives: exactly one of several variations is applied to each configuration."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from robovast.base.plugins import split_file_reference
from robovast.model.variation_config import VariationConfig, get_validated_config
from robovast.model.variations.base_variation import Variation

_OneCall = Annotated[dict[str, Any], Field(min_length=1, max_length=1)]


class OneOfVariationConfig(VariationConfig):
    """Parameters of OneOfVariation."""

    variations: Annotated[list[str | _OneCall], Field(min_length=1)]
    """The alternatives, each written as in `configuration[].variations`."""


class OneOfVariation(Variation):
    """Combines the configurations of several alternative variations.

    Variations in sequence multiply the number of configurations; alternatives add to it.
    """

    CONFIG_CLASS = OneOfVariationConfig
    pure = True
    _applied: tuple[Variation, ...] = ()

    @classmethod
    def is_pure(cls, parameters: Any) -> bool:
        """True if all alternatives are pure."""
        from robovast.model.variations.loader import is_pure

        given = get_validated_config(parameters, OneOfVariationConfig)
        return super().is_pure(parameters) and all(is_pure(*_call(c)) for c in given.variations)

    @classmethod
    def most_of_each(cls, parameters: Any, base_path: str) -> int | None:
        """The sum over all alternatives."""
        from robovast.model.variations.loader import most_of_each

        given = get_validated_config(parameters, OneOfVariationConfig)
        return sum(most_of_each(*_call(item), base_path) for item in given.variations)

    @classmethod
    def levels(cls, parameters: Any, base_path: str) -> int | None:
        """The sum over all alternatives, if each has values."""
        from robovast.model.variations.loader import levels

        given = get_validated_config(parameters, OneOfVariationConfig)
        each = [levels(*_call(item), base_path) for item in given.variations]
        return None if None in each else sum(number or 0 for number in each)

    def variation(self, in_configs: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """The first alternative's configurations, then the second's, and so on."""
        result = []
        for config in in_configs:
            for definition in self.parameters.variations:
                made = self._alternative(definition).variation([{**config}])
                # Each alternative numbers only its own configurations; the union is numbered here.
                result += [
                    self.update_config({**item, "name": config["name"]}, {}) for item in made
                ]
        return result

    def _alternative(self, definition: str | dict[str, Any]) -> Variation:
        from robovast.model.variations.loader import load_variation

        name, parameters = _call(definition)
        alternative = load_variation(name, self.base_path)(
            self.base_path,
            parameters or {},
            self.general_parameters,
            self.progress_update_callback,
            self.scenario_file,
            self.output_dir,
            self.container_runner,
        )
        alternative.entry = self.entry
        self._applied += (alternative,)
        return alternative

    def get_input_files(self) -> list[str]:
        """Input files of the alternatives, and alternatives that are files themselves."""
        names = (_call(item)[0] for item in self.parameters.variations)
        references = filter(None, map(split_file_reference, names))
        read = (name for applied in self._applied for name in applied.get_input_files())
        return [*(path for path, _ in references), *read]

    def get_campaign_transient_files(self) -> list[tuple[str, str]]:
        """Transient files of the alternatives."""
        return [pair for one in self._applied for pair in one.get_campaign_transient_files()]


def _call(definition: str | dict[str, Any]) -> tuple[str, Any]:
    """An alternative's name and parameters."""
    return (definition, {}) if isinstance(definition, str) else next(iter(definition.items()))

"""Variations of scenario parameters: listed values, or values drawn from a distribution."""

from __future__ import annotations

import hashlib
import math
import random
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any

from pydantic import AliasChoices, ConfigDict, Field, model_validator

from robovast.base.yaml_files import parse_yaml
from robovast.model.scenario import parameter_types
from robovast.model.variation_config import VariationConfig, get_validated_config
from robovast.model.variations.base_variation import Given, Variation
from robovast.model.variations.legacy_random import LegacyRandom

Configs = list[dict[str, Any]]
Value = int | float | str | bool


class ParameterVariationListConfig(VariationConfig):
    """Parameters of ParameterVariationList."""

    name: str | Annotated[list[str], Field(min_length=1)]
    """The scenario parameter, or several that change together."""
    values: Annotated[list[Any], Field(min_length=1)]
    """One value for each configuration; with several parameters, lists as long as `name`."""

    @model_validator(mode="after")
    def _as_many_values_as_names(self) -> ParameterVariationListConfig:
        if isinstance(self.name, str):
            return self
        for position, item in enumerate(self.values):
            if not isinstance(item, list) or len(item) != len(self.name):
                raise ValueError(
                    f"`values[{position}]` must be a list of {len(self.name)} values, one for each "
                    f"of {', '.join(self.name)}"
                )
        return self


class ParameterVariationList(Variation):
    """One configuration for each value of a list."""

    CONFIG_CLASS = ParameterVariationListConfig
    pure = True

    @classmethod
    def most_of_each(cls, parameters: Any, base_path: str) -> int | None:
        """The number of values."""
        del base_path
        return len(get_validated_config(parameters, ParameterVariationListConfig).values)

    @classmethod
    def levels(cls, parameters: Any, base_path: str) -> int | None:
        """The number of values."""
        return cls.most_of_each(parameters, base_path)

    def variation(self, in_configs: Configs) -> Configs:
        """Each configuration with each value."""
        chosen = list(_chosen(self.parameters, parameter_types(self.scenario_file)))
        return [self.update_config(c, values) for c in in_configs for values in chosen]

    @classmethod
    def given_values(cls, parameters: Any, types: Mapping[str, str]) -> Iterator[Given]:
        """Each value."""
        config = get_validated_config(parameters, ParameterVariationListConfig)
        for row, values in enumerate(_chosen(config, types)):
            for column, (name, value) in enumerate(values.items()):
                inner = () if isinstance(config.name, str) else (column,)
                yield Given(("values", row, *inner), name, value)


def _chosen(
    config: ParameterVariationListConfig, types: Mapping[str, str]
) -> Iterator[dict[str, Any]]:
    """The values of each configuration."""
    name = config.name
    for item in config.values:
        if isinstance(name, list):
            yield dict(zip(name, item, strict=True))
        else:
            yield {name: item if types.get(name) == "string" else _number_in(item)}


def _number_in(value: Any) -> Any:
    """The number or truth value that a text represents; any other value unchanged."""
    if not isinstance(value, str):
        return value
    try:
        read = parse_yaml(value)
    except ValueError:
        return value
    return read if isinstance(read, bool | int | float) else value


_KINDS: Mapping[str, str] = {
    "int": "int", "integer": "int", "float": "float", "double": "float", "number": "float",
    "bool": "bool",
}  # fmt: skip
_TEXT = frozenset({"string", "str", "text"})


class _Number(VariationConfig):
    model_config = ConfigDict(extra="ignore")

    num_variations: Annotated[int, Field(ge=1)]


class _DistributionConfig(VariationConfig):
    name: str
    """Scenario parameter."""
    num_variations: Annotated[int, Field(ge=1)]
    """Number of values to draw."""
    type: str = "float"
    """Type of the values: `int` or `integer`, `float`, `double` or `number`, `bool`; else text."""
    seed: int | None = None
    """Seed; by default derived from the names of the configuration and the parameter."""

    @property
    def kind(self) -> str:
        """`int`, `float`, `bool` or `text`."""
        return _KINDS.get(self.type, "text")


class ParameterVariationDistributionUniformConfig(_DistributionConfig):
    """Parameters of ParameterVariationDistributionUniform."""

    min: float
    """One end of the values."""
    max: float
    """The other end; for `bool`, the share of true values."""


class ParameterVariationDistributionGaussianConfig(_DistributionConfig):
    """Parameters of ParameterVariationDistributionGaussian."""

    seed: Annotated[int, Field(ge=0, lt=2**32)] | None = None
    """Seed; by default derived from the names of the configuration and the parameter."""
    mean: float
    """Mean of the distribution; a `bool` is true from there on."""
    std: Annotated[float, Field(ge=0, validation_alias=AliasChoices("std", "std_dev"))]
    """Standard deviation."""
    min: float | None = None
    """Lower values are raised to this."""
    max: float | None = None
    """Higher values are lowered to this."""


class _Drawn(_DistributionConfig):
    model_config = ConfigDict(extra="ignore")


_OF_KIND: Mapping[str, Value] = {"int": 1, "float": 0.5, "bool": True, "text": "1"}
_NO_TYPE = "Without `type`, fractions are drawn."


class _DistributionVariation(Variation):
    @classmethod
    def most_of_each(cls, parameters: Any, base_path: str) -> int | None:
        """The number of drawn values."""
        del base_path
        return _Number.model_validate(parameters).num_variations

    @classmethod
    def given_values(cls, parameters: Any, types: Mapping[str, str]) -> Iterator[Given]:
        """A value of the kind that is drawn."""
        del types
        config = _Drawn.model_validate(parameters)
        path = ("type",) if "type" in parameters else ()
        remedy = f"`type: {config.type}` draws such values." if path else _NO_TYPE
        yield Given(path, config.name, _OF_KIND[config.kind], remedy)

    def _with_each(self, in_configs: Configs, draw: Callable[[], Value]) -> Configs:
        """Each configuration with each drawn value; all configurations get the same values."""
        name, kind = self.parameters.name, self.parameters.type
        if self.parameters.kind == "text" and kind not in _TEXT:
            self.progress_update(f"`type: {kind}` is not a known type: the values are text")
        values = [draw() for _ in range(self.parameters.num_variations)]
        return [self.update_config(c, {name: value}) for c in in_configs for value in values]

    def _seed(self) -> int:
        if self.parameters.seed is not None:
            return int(self.parameters.seed)
        identity = f"{self.entry}/{self.parameters.name}".encode()
        return int.from_bytes(hashlib.sha256(identity).digest()[:4])


class ParameterVariationDistributionUniform(_DistributionVariation):
    """Draws values from a uniform distribution; integers include both ends, cut to whole numbers.

    The values are those of Python's `random` with the same seed.
    """

    CONFIG_CLASS = ParameterVariationDistributionUniformConfig
    pure = True

    def variation(self, in_configs: Configs) -> Configs:
        """Each configuration with each drawn value."""
        generator = random.Random(self._seed())  # noqa: S311  # repeatable on purpose
        return self._with_each(in_configs, lambda: self._draw(generator))

    def _draw(self, generator: random.Random) -> Value:
        kind, low, high = self.parameters.kind, self.parameters.min, self.parameters.max
        if kind == "bool":
            return bool(generator.random() < high)
        ends_are_whole = low.is_integer() and high.is_integer()
        if kind == "int" or (kind == "text" and ends_are_whole):
            drawn: float = generator.randint(*sorted((int(low), int(high))))
        else:
            drawn = generator.uniform(low, high)
        return str(drawn) if kind == "text" else drawn


class ParameterVariationDistributionGaussian(_DistributionVariation):
    """Draws values from a normal distribution, as `numpy.random.seed` and `.normal` do."""

    CONFIG_CLASS = ParameterVariationDistributionGaussianConfig
    pure = True

    def variation(self, in_configs: Configs) -> Configs:
        """Each configuration with each drawn value."""
        generator = LegacyRandom(self._seed())
        return self._with_each(in_configs, lambda: self._draw(generator))

    def _draw(self, generator: LegacyRandom) -> Value:
        settings: ParameterVariationDistributionGaussianConfig = self.parameters
        value = generator.normal(settings.mean, settings.std)
        low = -math.inf if settings.min is None else settings.min
        high = math.inf if settings.max is None else settings.max
        value = min(high, max(low, value))
        match settings.kind:
            case "int":
                return int(value)
            case "bool":
                return bool(value >= settings.mean)
            case "text":
                return str(value)
        return value

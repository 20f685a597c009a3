"""Variations of one scenario parameter: listed values, or values drawn from a distribution."""

from __future__ import annotations

import hashlib
import random
from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import AliasChoices, Field, model_validator

from robovast.common.config import VariationConfig
from robovast.common.variation.base_variation import Variation

Configs = list[dict[str, Any]]


class ParameterVariationListConfig(VariationConfig):
    """Parameters of ParameterVariationList."""

    name: str
    """Scenario parameter."""
    values: Annotated[list[Any], Field(min_length=1)]
    """Its values, one configuration for each."""


class ParameterVariationList(Variation):
    """One configuration for each value of a list."""

    CONFIG_CLASS = ParameterVariationListConfig

    def variation(self, in_configs: Configs) -> Configs:
        """Each configuration with each value."""
        name, values = self.parameters.name, self.parameters.values
        return [self.update_config(c, {name: value}) for c in in_configs for value in values]


class _DistributionConfig(VariationConfig):
    name: str
    """Scenario parameter."""
    num_variations: Annotated[int, Field(ge=1)]
    """Number of values to draw."""
    type: Literal["int", "float", "string"] = "float"
    """Type of the values; `int` rounds, `string` is the number as text."""
    seed: int | None = None
    """Seed; without one it follows from the configuration's and the parameter's name."""


class ParameterVariationDistributionUniformConfig(_DistributionConfig):
    """Parameters of ParameterVariationDistributionUniform."""

    min: float
    """Least value."""
    max: float
    """Largest value."""

    @model_validator(mode="after")
    def _check_range(self) -> ParameterVariationDistributionUniformConfig:
        if self.min > self.max:
            raise ValueError("`min` must not be above `max`")
        return self


class ParameterVariationDistributionGaussianConfig(_DistributionConfig):
    """Parameters of ParameterVariationDistributionGaussian."""

    mean: float
    """Mean of the distribution."""
    std: Annotated[float, Field(ge=0, validation_alias=AliasChoices("std", "std_dev"))]
    """Standard deviation."""
    min: float | None = None
    """Lower values are raised to this."""
    max: float | None = None
    """Higher values are lowered to this."""


class _DistributionVariation(Variation):
    def _draw(self, in_configs: Configs, draw: Callable[[random.Random], float]) -> Configs:
        """Each configuration with each drawn value; all get the same values."""
        name = self.parameters.name
        seed = self.parameters.seed
        if seed is None:
            identity = f"{self.entry}/{name}".encode()
            seed = int.from_bytes(hashlib.sha256(identity).digest()[:8])
        generator = random.Random(seed)  # noqa: S311  # repeatable on purpose
        values = [self._typed(draw(generator)) for _ in range(self.parameters.num_variations)]
        return [self.update_config(c, {name: value}) for c in in_configs for value in values]

    def _typed(self, value: float) -> int | float | str:
        if self.parameters.type == "int":
            return round(value)
        return str(value) if self.parameters.type == "string" else value


class ParameterVariationDistributionUniform(_DistributionVariation):
    """Values drawn from a uniform distribution; integers include both ends."""

    CONFIG_CLASS = ParameterVariationDistributionUniformConfig

    def variation(self, in_configs: Configs) -> Configs:
        """Each configuration with each drawn value."""
        low, high = self.parameters.min, self.parameters.max
        if self.parameters.type == "int":
            return self._draw(in_configs, lambda r: r.randint(round(low), round(high)))
        return self._draw(in_configs, lambda r: r.uniform(low, high))


class ParameterVariationDistributionGaussian(_DistributionVariation):
    """Values drawn from a normal distribution."""

    CONFIG_CLASS = ParameterVariationDistributionGaussianConfig

    def variation(self, in_configs: Configs) -> Configs:
        """Each configuration with each drawn value."""
        low = -float("inf") if self.parameters.min is None else self.parameters.min
        high = float("inf") if self.parameters.max is None else self.parameters.max
        mean, std = self.parameters.mean, self.parameters.std
        return self._draw(in_configs, lambda r: min(high, max(low, r.gauss(mean, std))))

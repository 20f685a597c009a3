"""Variation types: their base class and the built-in ones."""

from robovast.model.variations.base_variation import ProvContribution, Variation
from robovast.model.variations.factors import Factor
from robovast.model.variations.one_of_variation import OneOfVariation
from robovast.model.variations.parameter_variation import (
    ParameterVariationDistributionGaussian,
    ParameterVariationDistributionUniform,
    ParameterVariationList,
)

BUILT_IN_TYPES = (
    OneOfVariation,
    ParameterVariationDistributionGaussian,
    ParameterVariationDistributionUniform,
    ParameterVariationList,
)
"""Built-in types that need only a scenario; their names are those of their classes."""

__all__ = [
    "BUILT_IN_TYPES",
    "Factor",
    "OneOfVariation",
    "ParameterVariationDistributionGaussian",
    "ParameterVariationDistributionUniform",
    "ParameterVariationList",
    "ProvContribution",
    "Variation",
]

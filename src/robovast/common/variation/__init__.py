"""Variation types: their base class and the built-in ones."""

from robovast.common.variation.base_variation import ProvContribution, Variation
from robovast.common.variation.one_of_variation import OneOfVariation
from robovast.common.variation.parameter_variation import (
    ParameterVariationDistributionGaussian,
    ParameterVariationDistributionUniform,
    ParameterVariationList,
)

__all__ = [
    "OneOfVariation",
    "ParameterVariationDistributionGaussian",
    "ParameterVariationDistributionUniform",
    "ParameterVariationList",
    "ProvContribution",
    "Variation",
]

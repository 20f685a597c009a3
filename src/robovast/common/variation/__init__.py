"""Variation types, for plugins."""

from robovast.model.variations import (
    OneOfVariation,
    ParameterVariationDistributionGaussian,
    ParameterVariationDistributionUniform,
    ParameterVariationList,
    ProvContribution,
    Variation,
)

__all__ = [
    "OneOfVariation",
    "ParameterVariationDistributionGaussian",
    "ParameterVariationDistributionUniform",
    "ParameterVariationList",
    "ProvContribution",
    "Variation",
]

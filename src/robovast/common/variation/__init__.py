"""Variation types, for plugins."""

from robovast.model.variations import (
    Factor,
    OneOfVariation,
    ParameterVariationDistributionGaussian,
    ParameterVariationDistributionUniform,
    ParameterVariationList,
    ProvContribution,
    Variation,
)

__all__ = [
    "Factor",
    "OneOfVariation",
    "ParameterVariationDistributionGaussian",
    "ParameterVariationDistributionUniform",
    "ParameterVariationList",
    "ProvContribution",
    "Variation",
]

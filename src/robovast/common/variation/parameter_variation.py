"""Variations of scenario parameters, for plugins."""

from robovast.model.variations.parameter_variation import (
    ParameterVariationDistributionGaussian,
    ParameterVariationDistributionUniform,
    ParameterVariationList,
)

__all__ = [
    "ParameterVariationDistributionGaussian",
    "ParameterVariationDistributionUniform",
    "ParameterVariationList",
]

"""Parameter models of variation types, for plugins."""

from robovast.model.variation_config import (
    VariationConfig,
    convert_dataclasses_to_dict,
    filter_configs,
    get_validated_config,
    load_config,
    match_var_marker,
    normalize_secondary_containers,
)

__all__ = [
    "VariationConfig",
    "convert_dataclasses_to_dict",
    "filter_configs",
    "get_validated_config",
    "load_config",
    "match_var_marker",
    "normalize_secondary_containers",
]

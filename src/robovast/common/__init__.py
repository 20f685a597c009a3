"""The public API for plugins and notebooks; names are imported on first use."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robovast.base.file_cache import FileCache
    from robovast.base.sizes import fmt_size
    from robovast.common.execution import (
        COMPAT_VERSION,
        get_campaign,
        get_campaign_timestamp,
        is_campaign_dir,
    )
    from robovast.common.generation import generate_scenario_variations
    from robovast.common.progress import ProgressBar
    from robovast.model.scenario import get_scenario_parameters, is_scenario_parameter
    from robovast.model.variation_config import (
        VariationConfig,
        convert_dataclasses_to_dict,
        filter_configs,
        get_validated_config,
        load_config,
        normalize_secondary_containers,
    )

_MODULES = {
    "COMPAT_VERSION": "execution",
    "FileCache": "file_cache",
    "ProgressBar": "progress",
    "VariationConfig": "config",
    "convert_dataclasses_to_dict": "config",
    "filter_configs": "config",
    "fmt_size": "progress",
    "generate_scenario_variations": "generation",
    "get_campaign": "execution",
    "get_campaign_timestamp": "execution",
    "get_scenario_parameters": "scenario",
    "get_validated_config": "config",
    "is_campaign_dir": "execution",
    "is_scenario_parameter": "scenario",
    "load_config": "config",
    "normalize_secondary_containers": "config",
}

__all__ = [
    "COMPAT_VERSION",
    "FileCache",
    "ProgressBar",
    "VariationConfig",
    "convert_dataclasses_to_dict",
    "filter_configs",
    "fmt_size",
    "generate_scenario_variations",
    "get_campaign",
    "get_campaign_timestamp",
    "get_scenario_parameters",
    "get_validated_config",
    "is_campaign_dir",
    "is_scenario_parameter",
    "load_config",
    "normalize_secondary_containers",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)

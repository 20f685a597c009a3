"""The parameters of a scenario, for plugins."""

from robovast.model.scenario import get_scenario_parameters, is_scenario_parameter

__all__ = ["get_scenario_parameters", "is_scenario_parameter"]

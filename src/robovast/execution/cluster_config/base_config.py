"""Another path of `BaseConfig`."""

from robovast.execution.cluster_config.base import BaseConfig

__all__ = ["BaseConfig"]

"""Another path of `BaseConfig`."""

from robovast.kubeapi.cluster_config.base import BaseConfig

__all__ = ["BaseConfig"]

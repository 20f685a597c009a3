"""The base class of cluster kinds, for plugins."""

from robovast.kubeapi.cluster_config.base import BaseConfig

__all__ = ["BaseConfig"]

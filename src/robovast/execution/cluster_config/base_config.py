"""The base class of kinds of clusters, for plugins."""

from robovast.kubeapi.cluster_config.base import BaseConfig

__all__ = ["BaseConfig"]

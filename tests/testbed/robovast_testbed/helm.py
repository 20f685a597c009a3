"""Helm, with its state in the cluster's testbed."""

import os
from pathlib import Path

from . import gobuild, programs
from .commands import run
from .kubernetes import Cluster


def helm(cluster: Cluster, *arguments: str | Path) -> str:
    """Run a Helm command against a cluster; return its standard output."""
    homes = {
        name: str(cluster.bed.folder / "helm" / name.lower())
        for name in ("HELM_CACHE_HOME", "HELM_CONFIG_HOME", "HELM_DATA_HOME")
    }
    return run([gobuild.build(programs.HELM), *arguments], env=os.environ | cluster.env | homes)

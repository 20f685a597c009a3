"""Fixtures of the tests that need engines, but no node."""

from support.kube.operator_process import fake_cluster, namespace, new_operator

__all__ = ["fake_cluster", "namespace", "new_operator"]

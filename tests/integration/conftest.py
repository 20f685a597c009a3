"""Fixtures of the tests that need engines, but no node."""

from collections.abc import Iterator
from uuid import uuid4

import pytest
from support.kube.operator_process import fake_cluster, namespace, new_operator

from robovast.storage.s3 import ObjectStore

__all__ = ["fake_cluster", "namespace", "new_operator"]


@pytest.fixture
def bucket(store: ObjectStore) -> Iterator[str]:
    """An empty bucket in the store of the test's module."""
    name = f"test-{uuid4().hex[:12]}"
    store.make_bucket(name)
    yield name
    store.delete_bucket(name)

"""How kopf calls the operator."""

from __future__ import annotations

import inspect
from typing import Any

import kopf
import pytest

from robovast_operator.__main__ import Handlers, configure
from robovast_operator.settings import OperatorSettings


@pytest.mark.parametrize("name", ["startup", "cleanup", "campaign", "configuration", "job"])
def test_kopf_tells_in_the_event_loop(name: str) -> None:
    """Plain functions it calls in threads, while the loop works with the same objects."""
    assert inspect.iscoroutinefunction(getattr(Handlers, name))


class Large(dict[str, Any]):
    """A part of an object that nobody may copy."""

    def __deepcopy__(self, memo: object) -> Large:
        raise AssertionError("copied")


def test_kopf_does_not_copy_objects_to_compare_them() -> None:
    settings = kopf.OperatorSettings()
    configure(settings, OperatorSettings(agent_image="agent:1", endpoint="http://s3:9000"))
    body = kopf.Body({"metadata": {"name": "drive"}, "spec": Large(), "status": Large()})
    storage = settings.persistence
    assert storage.diffbase_storage.fetch(body=body) is None
    compared = storage.diffbase_storage.build(body=body)
    assert not storage.progress_storage.clear(essence=compared)

"""How kopf calls the operator."""

from __future__ import annotations

import inspect

import pytest

from robovast_operator.__main__ import Handlers


@pytest.mark.parametrize("name", ["startup", "cleanup", "campaign", "configuration", "job"])
def test_kopf_tells_in_the_event_loop(name: str) -> None:
    """Plain functions it calls in threads, while the loop works with the same objects."""
    assert inspect.iscoroutinefunction(getattr(Handlers, name))

"""Every message that the operator makes in a test has the form of a sentence."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from support.sentences import Watch

from robovast.kubeapi.status import Condition
from robovast_operator.kube import conditions
from robovast_operator.kube.events import EventContent
from robovast_operator.planning.campaign import Rejected
from robovast_operator.pods.observations import Mishap, Trouble
from robovast_operator.pods.waiting import Waiting

CUT = 4000
"""Characters of a message after which a condition cuts it."""


@pytest.fixture(autouse=True)
def _sentences(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Fail if the operator makes a condition or an Event whose message is no sentence."""
    watch = Watch("robovast_operator", CUT)
    for kind in (Trouble, Mishap, Rejected, Waiting):
        monkeypatch.setattr(kind, "__init__", watch.on(kind))
    monkeypatch.setattr(EventContent, "__init__", watch.on(EventContent, "text"))

    def condition(**fields: Any) -> Condition:
        watch.look(fields["reason"], fields["message"])
        return Condition(**fields)

    monkeypatch.setattr(conditions, "Condition", condition)
    yield
    assert not watch.faults, "\n".join(dict.fromkeys(watch.faults))

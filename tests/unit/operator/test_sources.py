"""A Campaign reads only ConfigMaps that are meant for campaigns."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from support.kube.fake_cluster import SETTINGS, campaign

from robovast_operator.effects.inputs import Inputs
from robovast_operator.kube.api import ApiError
from robovast_operator.kube.objects import Identity
from robovast_operator.kube.store import Store
from robovast_operator.planning.campaign import Rejected

OBJ = campaign(source={"configMap": {"name": "app-settings"}})
IDENTITY = Identity.of(OBJ)


class Server:
    """Has some ConfigMaps."""

    def __init__(self, labels: dict[str, dict[str, str]]) -> None:
        self._labels = labels

    async def get(self, path: str) -> dict[str, Any]:
        name = path.rpartition("/")[2]
        if name not in self._labels:
            raise ApiError(404, "NotFound", "")
        return {"metadata": {"name": name, "labels": self._labels[name]}, "data": {"a": "password"}}


@pytest.mark.parametrize(
    ("there", "reason"),
    [
        ({}, "SourceNotFound"),
        ({"app-settings": {}}, "SourceNotAllowed"),
        ({"app-settings": {"robovast.io/source": "false"}}, "SourceNotAllowed"),
        ({"app-settings": {"robovast.io/source": "true"}}, ""),
        ({IDENTITY.files: IDENTITY.labels}, ""),
        ({IDENTITY.files: {}}, "SourceNotAllowed"),
    ],
)
def test_a_config_map_opts_in_by_a_label(there: dict[str, dict[str, str]], reason: str) -> None:
    server: Any = Server(there)
    inputs = Inputs(server, Store(), SETTINGS, lambda _: None)
    found = asyncio.run(inputs._source(OBJ))
    if reason:
        assert isinstance(found, Rejected)
        assert found.reason == reason
        assert "app-settings" in found.message or IDENTITY.files in found.message
    else:
        assert isinstance(found, dict)

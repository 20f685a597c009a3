"""Lists of objects, which the operator reads page by page."""

from __future__ import annotations

import asyncio
import weakref
from collections.abc import Mapping
from typing import Any

from robovast_operator.kube.api import Api
from robovast_operator.kube.objects import Object


class Item(dict[str, Any]):
    """An object of which one sees whether anybody holds it."""


class Server(Api):
    """A server with two pages of two pods."""

    def __init__(self) -> None:
        super().__init__(None)
        self.made: list[weakref.ref[Item]] = []
        self.alive_at: list[int] = []
        """How many pods were held whenever a page was asked for."""

    async def _request(
        self, *_: object, query: Mapping[str, str] | None = None, **__: object
    ) -> Object:
        self.alive_at.append(sum(item() is not None for item in self.made))
        second = "continue" in (query or {})
        items = [Item(metadata={"name": name}) for name in ("cd" if second else "ab")]
        self.made += map(weakref.ref, items)
        return {"items": items, "metadata": {} if second else {"continue": "x"}}


async def names(server: Server) -> list[str]:
    return [pod["metadata"]["name"] async for pod in server.list("/pods")]


def test_all_pages_are_read_in_order_and_only_one_is_held() -> None:
    server = Server()
    assert asyncio.run(names(server)) == ["a", "b", "c", "d"]
    assert server.alive_at == [0, 0]

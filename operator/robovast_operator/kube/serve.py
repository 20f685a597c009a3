"""The pages that Kubernetes and Prometheus read: /healthz, /readyz, /metrics."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from aiohttp import web

if TYPE_CHECKING:
    from robovast_operator.operator import Operator


async def serve(operator: Operator, port: int) -> None:
    """Serve the pages, for ever."""

    async def healthz(request: web.Request) -> web.Response:
        del request
        return _answer(operator.healthy())

    async def readyz(request: web.Request) -> web.Response:
        del request
        return _answer(operator.ready())

    async def metrics(request: web.Request) -> web.Response:
        del request
        leading = operator.leadership.leading
        page = operator.metrics.page(operator.store, operator.queue, leading=leading)
        return web.Response(body=page, content_type="text/plain")

    app = web.Application()
    app.add_routes(
        [
            web.get("/healthz", healthz),
            web.get("/readyz", readyz),
            web.get("/metrics", metrics),
        ]
    )
    runner = web.AppRunner(app, access_log=None)
    await runner.setup()
    try:
        await web.TCPSite(runner, port=port).start()
        await asyncio.Event().wait()
    finally:
        await runner.cleanup()


def _answer(problem: str) -> web.Response:
    return web.Response(status=500 if problem else 200, text=problem or "ok")

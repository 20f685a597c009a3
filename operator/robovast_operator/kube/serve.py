"""HTTP endpoints for Kubernetes and Prometheus: /healthz, /readyz, /metrics."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from aiohttp import web


async def serve(
    port: int, healthy: Callable[[], str], ready: Callable[[], str], metrics: Callable[[], bytes]
) -> None:
    """Serve the endpoints, without end.

    Args:
        port: the port, on all addresses of the pod.
        healthy: returns why the process must be restarted; empty if it is healthy.
        ready: returns why the operator cannot work yet; empty if it can.
        metrics: returns the metrics in Prometheus' format.
    """

    async def page(request: web.Request) -> web.Response:
        if request.path == "/metrics":
            return web.Response(body=metrics(), content_type="text/plain")
        return _answer(healthy() if request.path == "/healthz" else ready())

    app = web.Application()
    app.add_routes([web.get(path, page) for path in ("/healthz", "/readyz", "/metrics")])
    runner = web.AppRunner(app, access_log=None)
    await runner.setup()
    try:
        await web.TCPSite(runner, port=port).start()
        await asyncio.Event().wait()
    finally:
        await runner.cleanup()


def _answer(problem: str) -> web.Response:
    return web.Response(status=500 if problem else 200, text=problem or "ok")

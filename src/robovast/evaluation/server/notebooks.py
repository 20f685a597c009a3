"""Notebooks: listing, executing and showing them."""

from __future__ import annotations

import asyncio
import shlex
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from robovast.base.errors import InputError
from robovast.evaluation.library import Library
from robovast.evaluation.notebooks.runner import NotebookResult, Runner, data_key, make_task
from robovast.evaluation.notebooks.workloads import (
    Notebook,
    Target,
    find_notebook,
    find_notebooks,
)
from robovast.evaluation.server.answers import Data

POLICY = "; ".join(
    (
        "default-src 'none'",
        "style-src 'unsafe-inline'",
        "img-src data:",
        "font-src data:",
        "media-src data:",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'self'",
        "sandbox",
    )
)
"""Policy for notebook output: any style, but no script, no request and no other origin."""


@dataclass(frozen=True)
class NotebookEntry:
    """A notebook that can be executed."""

    workload: str
    path: str
    command: str
    """Opens it in Jupyter."""
    fault: str = ""
    """Why it cannot be executed."""
    running: bool = False
    result: NotebookResult | None = None
    """Of the last execution with the same data."""


class NotebookPages:
    """Responses about the notebooks of a results folder."""

    def __init__(self, library: Library, runner: Runner, override: Path | None) -> None:
        self._library = library
        self._runner = runner
        self._override = override

    def listed(self, request: Request) -> Response:
        """The notebooks for a campaign, a configuration or a run, without executing any."""
        target = self._target(request)
        found = find_notebooks(target, self._override)
        data = data_key(target) if found else ""
        return Data([self._entry(notebook, target, data) for notebook in found])

    async def executed(self, request: Request) -> Response:
        """The result of the notebook of `workload`; `again` repeats a previous execution."""
        future = await run_in_threadpool(self._execute, request)
        return Data(await asyncio.shield(asyncio.wrap_future(future)))

    def shown(self, request: Request) -> Response:
        """The output, as a document for a sandboxed frame."""
        headers = {"content-security-policy": POLICY, "x-frame-options": "SAMEORIGIN"}
        content = self._runner.html(request.path_params["key"])
        return Response(content, headers=headers, media_type="text/html; charset=utf-8")

    def _target(self, request: Request) -> Target:
        asked = (request.query_params.get(key) for key in ("campaign", "variant", "run"))
        names = tuple(name for name in asked if name)
        if not names:
            raise InputError("The request names no `campaign`.")
        if len(names) == 3:
            self._library.bring("/".join(names))
        else:
            self._library.require_all("A notebook")
        target = Target(self._library.results, names, _batch(request.query_params.get("batch")))
        _ = target.folder  # raises unless it is a results folder
        return target

    def _execute(self, request: Request) -> Future[NotebookResult]:
        target = self._target(request)
        workload = request.query_params.get("workload")
        notebook = find_notebook(target, workload, self._override)
        task = make_task(notebook, target, data_key(target))
        return self._runner.execute(task, again="again" in request.query_params)

    def _entry(self, notebook: Notebook, target: Target, data: str) -> NotebookEntry:
        shown = (notebook.workload, str(notebook.path), self._command(notebook, target))
        try:
            key = make_task(notebook, target, data).key
        except InputError as error:
            return NotebookEntry(*shown, fault=str(error))
        running = self._runner.is_waiting(key)
        return NotebookEntry(*shown, running=running, result=self._runner.kept(key))

    def _command(self, notebook: Notebook, target: Target) -> str:
        words = ["vast", "evaluation", "notebook", str(target.folder), notebook.workload]
        words += [] if target.batch is None else ["--batch", str(target.batch)]
        override = ["-o", str(self._override.resolve())] if self._override else []
        return shlex.join(words + override)


def _batch(asked: str | None) -> int | None:
    if not asked:
        return None
    if not asked.isdecimal() or not asked.isascii() or len(asked) > 9:
        raise InputError(f"{asked!r} is not a valid batch number.")
    return int(asked)

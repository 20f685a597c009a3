"""The routes of the server."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib.resources import files
from pathlib import PurePosixPath

from starlette.applications import Starlette
from starlette.convertors import IntegerConvertor, register_url_convertor
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import BaseRoute, Mount, Route
from starlette.types import ASGIApp

from robovast.base.errors import InputError, RobovastError
from robovast.base.optional_deps import missing_extra
from robovast.campaign.planned_runs import planned_runs
from robovast.evaluation.campaign_inputs import about, changes
from robovast.evaluation.columns import columns
from robovast.evaluation.compare import compare
from robovast.evaluation.configuration_index import default_index
from robovast.evaluation.confined_files import OutsideError, open_inside
from robovast.evaluation.factors import Explanations
from robovast.evaluation.history import history
from robovast.evaluation.launch.cluster_commands import more_in_cluster
from robovast.evaluation.launch.commands import (
    as_shell,
    more_runs_command,
    more_runs_words,
    read_choices,
    resume_words,
)
from robovast.evaluation.launch.launcher import BusyError
from robovast.evaluation.library import Library
from robovast.evaluation.log_search import search_logs
from robovast.evaluation.logs import LogQuestion, read_log
from robovast.evaluation.map_picture import draw_map
from robovast.evaluation.metrics import constant_columns, metric, metric_columns
from robovast.evaluation.rates import why_wider
from robovast.evaluation.run import read_run
from robovast.evaluation.server.answers import Data, Picture, error, send_file
from robovast.evaluation.server.drives import DrivePages
from robovast.evaluation.server.guard import RequestGuard
from robovast.evaluation.server.launches import LaunchPages
from robovast.evaluation.server.live import events
from robovast.evaluation.server.notebooks import NotebookPages
from robovast.evaluation.server.preparing import Preparation
from robovast.evaluation.server.searches import SearchPages
from robovast.evaluation.server.web_api import (
    Campaigns,
    Columns,
    Compared,
    Factors,
    MetricColumns,
    MoreRuns,
    RunAnswer,
    RunResult,
)
from robovast.evaluation.tables import read_table, read_usage

_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}


class _Number(IntegerConvertor):
    """A number in a path; longer ones, which Python refuses to read, have no page."""

    regex = "[0-9]{1,18}"


register_url_convertor("int", _Number())

_PATIENCE = 2.0
"""How long campaigns may be searched for one answer [s]."""

_STATUS: Mapping[type[Exception], int] = {OutsideError: 403, BusyError: 409}


def make_app(
    library: Library,
    notebooks: NotebookPages,
    launches: LaunchPages,
    token: str,
    closing: asyncio.Event,
    preparation: Preparation | None = None,
) -> ASGIApp:
    """The server's application.

    Args:
        library: the campaigns.
        notebooks: responses about notebooks.
        launches: responses about campaigns started from the page.
        token: secret that is the first part of every path.
        closing: set when the server ends; open streams then end.
        preparation: makes tables meanwhile; None if nothing does.
    """
    pages = Pages(library, launches, closing, preparation)
    api = _api(pages, DrivePages(library), SearchPages(library), notebooks, launches)
    quickly, well = (Middleware(GZipMiddleware, compresslevel=level) for level in (3, 9))
    app = Starlette(
        routes=[
            Mount("/api", routes=api, middleware=[quickly]),
            Route("/files/{path:path}", pages.file),
            Route("/notebooks/{key}", notebooks.shown),
            *(Route(path, asset, middleware=[well]) for path, asset in _assets().items()),
        ],
        exception_handlers={
            RobovastError: _refuse,
            HTTPException: _refuse_http,
            Exception: _own_fault,
        },
    )
    return RequestGuard(app, token)


def _api(
    pages: Pages,
    drives: DrivePages,
    searches: SearchPages,
    notebooks: NotebookPages,
    launches: LaunchPages,
) -> list[BaseRoute]:
    """The paths below `/api`."""
    return [
        Route("/campaigns", pages.campaigns),
        Route("/reading", pages.reading),
        Route("/campaigns/{campaign}", pages.campaign),
        Route("/campaigns/{campaign}/begun", pages.begun),
        Route("/campaigns/{campaign}/about", pages.about),
        Route("/campaigns/{campaign}/factors", pages.factors),
        Route("/campaigns/{campaign}/metrics", pages.metrics),
        Route("/campaigns/{campaign}/logs", pages.logs),
        Route("/campaigns/{campaign}/more", pages.more),
        Route("/campaigns/{campaign}/metric", pages.metric),
        Route("/campaigns/{campaign}/{variant}/{run:int}", pages.run),
        Route("/history/{campaign}/{variant}", pages.history),
        *searches.routes,
        Route("/map/{campaign}/{variant}", pages.map),
        Route("/maps/{campaign}", drives.maps),
        Route("/failures/{campaign}", drives.failures),
        Route("/drive/{campaign}/{variant}/{run:int}", drives.drive),
        Route("/drive/{campaign}/{variant}/{run:int}/{part:int}", drives.part),
        Route("/drive/{campaign}/{variant}/{run:int}/{part:int}/pictures", drives.pictures),
        Route("/compare", pages.compare),
        Route("/comparisons", pages.comparisons),
        Route("/changes", pages.changes),
        Route("/events", pages.events),
        Route("/log", pages.log),
        Route("/table", pages.table),
        Route("/notebooks", notebooks.listed),
        Route("/notebook", notebooks.executed, methods=["POST"]),
        Route("/offer", launches.offered),
        Route("/expansion", launches.expanded, methods=["POST"]),
        Route("/start", launches.started, methods=["POST"]),
        Route("/repeat", launches.repeated, methods=["POST"]),
        Route("/more", pages.more_runs, methods=["POST"]),
        Route("/stop", launches.stopped, methods=["POST"]),
        Route("/timeline", pages.timeline),
        Route("/usage", pages.usage),
    ]


class Pages:
    """Responses about the campaigns of a library."""

    def __init__(
        self,
        library: Library,
        launches: LaunchPages,
        closing: asyncio.Event,
        preparation: Preparation | None,
    ) -> None:
        self._library = library
        self._preparation = preparation
        self._launches = launches
        self._closing = closing
        self._explanations = Explanations(library)
        self._index = default_index()

    def campaigns(self, _: Request) -> Response:
        """Summaries of all campaigns, the newest first.

        Null for a campaign that has not been read yet; `faults` says why others cannot be read.
        """
        known = {name: self._library.known(name) for name in self._library.names()}
        return Data(
            Campaigns(
                results=self._library.place,
                campaigns={name: summary for name, (summary, _) in known.items()},
                faults={name: fault for name, (_, fault) in known.items() if fault},
            )
        )

    def reading(self, _: Request) -> Response:
        """How far campaigns are read that are being read."""
        return Data(self._library.reading())

    def campaign(self, request: Request) -> Response:
        """One campaign with all its runs as columns."""
        name = request.path_params["campaign"]
        index = self._library.campaign(name)
        summary = self._library.summary(name)
        return Data(
            Columns(
                **vars(columns(index.variants, summary.test)),
                summary=summary,
                reading=None,
                active=index.active or (),
                search=summary.is_search,
                resume=as_shell(resume_words(self._library.results, summary)),
                wider=why_wider(summary),
            )
        )

    def begun(self, request: Request) -> Response:
        """What has been read of a campaign so far, and how much of it; null if all or nothing is.

        As `campaign` answers, without what is known only of all runs.
        """
        index = self._library.begun(request.path_params["campaign"])
        reading = None if index is None else index.reading
        if index is None or reading is None:
            return Data(None)
        summary, variants = index.begun()
        if not variants:
            return Data(None)
        return Data(
            Columns(
                **vars(columns(variants)),
                summary=summary,
                reading=reading,
                active=(),
                search=False,
                resume="",
                wider="",
            )
        )

    def about(self, request: Request) -> Response:
        """What a campaign says of itself."""
        name = self._library.summary(request.path_params["campaign"]).name
        return Data(about(self._library.results, name))

    def factors(self, request: Request) -> Response:
        """What a campaign varied, which of it separates failures, and of which version."""
        version, found = self._explanations.of(request.path_params["campaign"])
        return Data(Factors(**vars(found), version=version))

    def metrics(self, request: Request) -> Response:
        """Numeric columns of a campaign's tables, by table, and those with one value everywhere."""
        asked = (self._library.results, request.path_params["campaign"])
        return Data(MetricColumns(metric_columns(*asked), constant_columns(*asked)))

    def metric(self, request: Request) -> Response:
        """One number per run from `column` of `table`, by `aggregate`."""
        asked = (_query_parameter(request, key) for key in ("table", "column", "aggregate"))
        return Data(metric(self._library.results, request.path_params["campaign"], *asked))

    def logs(self, request: Request) -> Response:
        """Runs among `run` with `text` in a log."""
        self._library.require_all("Searching logs")
        runs = request.query_params.getlist("run")
        name = request.path_params["campaign"]
        return Data(
            search_logs(self._library.results, name, runs, _query_parameter(request, "text"))
        )

    def run(self, request: Request) -> Response:
        """One run; number, verdict and start of all runs of its variant."""
        names = request.path_params
        self._library.bring(f"{names['campaign']}/{names['variant']}/{names['run']}")
        found = read_run(self._library.results, names["campaign"], names["variant"], names["run"])
        index = self._library.campaign(names["campaign"])
        runs = next((v.runs for v in index.variants if v.name == names["variant"]), ())
        siblings = [(run.number, run.verdict, run.started_at) for run in runs]
        own = next((run for run in runs if run.number == names["run"]), None)
        result = None
        if own is not None:  # lists have the beginning of the reason
            result = RunResult(own.verdict, found.record.get("reason") or own.reason)
        if not self._library.lasts:
            found = replace(found, command="")  # it names files that go with the page
        return Data(RunAnswer(index.version, found, siblings, result))

    def more(self, request: Request) -> Response:
        """What gives each `config` of a campaign more runs."""
        index = self._library.campaign(request.path_params["campaign"])
        summary, chosen = self._library.summary(index.name), request.query_params.getlist("config")
        plan = planned_runs(summary.execution)
        each = (max(plan.of(v.name), len(v.runs)) for v in index.variants if v.name in chosen)
        words = more_runs_command(self._library.results, summary)
        is_here = summary.is_search or summary.execution.get("execution_type") != "cluster"
        asked = (self._library.results, index.name, index.variants, chosen)
        in_cluster = None if is_here or not chosen else more_in_cluster(*asked)
        return Data(
            MoreRuns(
                version=summary.version,
                command=as_shell(words),
                cluster=in_cluster,
                planned=max(each, default=0),
                widen=not why_wider(summary),
            )
        )

    def more_runs(self, request: Request) -> Response:
        """Raise the runs of each `config` of a campaign to `runs`; without any, of all of them.

        Raises:
            InputError: the campaign has no such configuration, or cannot be continued from here.
        """
        name, chosen = _query_parameter(request, "campaign"), request.query_params.getlist("config")
        runs = read_choices(request.query_params).runs
        known = {variant.name for variant in self._library.campaign(name).variants}
        summary = self._library.summary(name)
        words = more_runs_words(self._library.results, summary, chosen, runs or 0)
        if not words or not runs or not known.issuperset(chosen):
            raise InputError(f"{name} cannot be given such runs from here.")
        return self._launches.start(words, name, makes=name)

    def history(self, request: Request) -> Response:
        """A configuration in all campaigns; those that take too long are left to the next time."""
        self._library.require_all("The history")
        names = request.path_params
        results = self._library.results
        return Data(
            history(results, names["campaign"], names["variant"], self._index, limit=_PATIENCE)
        )

    def map(self, request: Request) -> Response:
        """A configuration drawn on its map."""
        names = request.path_params
        drawn = draw_map(self._library.results, names["campaign"], names["variant"])
        return Picture(drawn)

    def compare(self, request: Request) -> Response:
        """The comparison of the campaigns `a` and `b`."""
        a, b = (
            self._library.campaign(_query_parameter(request, key)).variants for key in ("a", "b")
        )
        return Data(compare(a, b))

    def comparisons(self, request: Request) -> Response:
        """Comparisons of the campaign `a` with each campaign `b`."""
        before = self._library.campaign(_query_parameter(request, "a")).variants
        names = request.query_params.getlist("b")
        return Data(
            [
                Compared(name, compare(before, self._library.campaign(name).variants))
                for name in names
            ]
        )

    def changes(self, request: Request) -> Response:
        """What differs between the inputs of the campaigns `a` and `b`."""
        a, b = (self._library.summary(_query_parameter(request, key)).name for key in ("a", "b"))
        results = self._library.results
        return Data(changes((results, a), (results, b)))

    async def events(self, _: Request) -> Response:
        """A stream of changes."""
        stream = events(self._library, self._launches, self._closing, self._preparation)
        return StreamingResponse(stream, media_type="text/event-stream")

    def log(self, request: Request) -> Response:
        """A page of the matching lines of the log `path`."""
        asked = request.query_params
        question = LogQuestion(
            text=asked.get("text", ""),
            levels=frozenset(filter(None, asked.get("levels", "").split(","))),
            since=_number(asked.get("since")),
            until=_number(asked.get("until")),
            before=int(_number(asked.get("before")) or 0) or None,
            end=int(_number(asked.get("end")) or 0) or None,
        )
        return Data(read_log(self._library.results, self._path(request), question))

    def table(self, request: Request) -> Response:
        """Columns of the CSV file `path`."""
        wanted = request.query_params.getlist("column")
        return Data(read_table(self._library.results, self._path(request), wanted))

    def usage(self, request: Request) -> Response:
        """Resource usage over time from the file `path`."""
        return Data(read_usage(self._library.results, self._path(request)))

    def timeline(self, request: Request) -> Response:
        """Messages over time of the bag `path`."""
        from robovast.evaluation.bag_timeline import read_timeline

        return Data(read_timeline(self._library.results, self._path(request)))

    def file(self, request: Request) -> Response:
        """An unchanged file."""
        path = request.path_params["path"]
        self._library.bring(path)
        file = open_inside(self._library.results, path)
        return send_file(file, PurePosixPath(path).name, request.headers.get("range"))

    def _path(self, request: Request) -> str:
        """The `path` of a request, whose files are made available."""
        path = _query_parameter(request, "path")
        self._library.bring(path)
        return path


def _assets() -> dict[str, Callable[[Request], Response]]:
    """Responses by path for the page's own files, which are read once."""
    found = {}
    for asset in files("robovast.evaluation.server").joinpath("assets").iterdir():
        media_type = _TYPES.get(PurePosixPath(asset.name).suffix)
        if media_type:
            path = "/" if asset.name == "index.html" else f"/{asset.name}"
            found[path] = _constant(asset.read_bytes(), media_type)
    return found


def _constant(content: bytes, media_type: str) -> Callable[[Request], Response]:
    def answer(_: Request) -> Response:
        return Response(content, media_type=media_type)

    return answer


def _query_parameter(request: Request, key: str) -> str:
    value = request.query_params.get(key)
    if value is None:
        raise InputError(f"The request names no `{key}`.")
    return value


def _number(text: str | None) -> float | None:
    try:
        number = None if text is None else float(text)
    except ValueError:
        number = math.nan
    if number is not None and not math.isfinite(number):
        raise InputError(f"{text!r} is not a number.")
    return number


def _refuse(_: Request, cause: Exception) -> Response:
    return error(str(cause), _STATUS.get(type(cause), 404))


def _refuse_http(_: Request, cause: Exception) -> Response:
    status = cause.status_code if isinstance(cause, HTTPException) else 500
    return error("There is no such page.", status)


def _own_fault(request: Request, cause: Exception) -> Response:
    if lacking := missing_extra(cause):
        return _refuse(request, lacking)
    name = type(cause).__name__
    where = "`vast -l debug evaluation gui` shows where"
    return error(f"This is a bug in RoboVAST ({name}: {cause}); {where}.", 500)

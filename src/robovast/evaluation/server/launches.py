"""Campaigns started from the page: their configurations, start, and output."""

from __future__ import annotations

import asyncio
import json
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from robovast.base.errors import CannotRunError, InputError
from robovast.base.file_errors import read_content
from robovast.evaluation.columns import columns
from robovast.evaluation.launch.commands import (
    expansion_words,
    postprocessing_words,
    read_choices,
    repeat_words,
    run_words,
)
from robovast.evaluation.launch.launcher import Launch, Launcher
from robovast.evaluation.run import run_record
from robovast.evaluation.server.answers import Data
from robovast.evaluation.summaries import VariantRuns
from robovast.evaluation.untrusted_data import mapping, parse_yaml, plain
from robovast.model.document.execution import RunsAsNeeded


@dataclass(frozen=True)
class Starting:
    """Settings for starting campaigns from the page."""

    program: Sequence[str]
    """Command line of `vast`; if empty, nothing can be started."""
    document: Path | None
    """The .vast file that can be run."""
    refusal: str
    """Why there is none, or why nothing can be started."""
    postprocess: bool
    """Whether tables are updated after a campaign."""
    message: Callable[[str], None]
    """Shows a message to the user who started the server."""


@dataclass(frozen=True)
class Offer:
    """What can be run from the web UI."""

    document: str | None
    runs: int
    """Of each configuration, at most; 0 without a document."""
    refusal: str
    """Why no campaign can be started."""
    repeat: bool
    """Whether a run can be executed again."""


@dataclass(frozen=True)
class News:
    """News about a task."""

    launch: Launch
    first: int
    """Number of the first of the lines, from 0."""
    lines: list[str]
    """New lines of its output."""

    @property
    def end(self) -> int:
        """Number of the next line."""
        return self.first + len(self.lines)


class LaunchPages:
    """Responses about campaigns started from the page."""

    def __init__(self, results: Path, starting: Starting, override: Path | None) -> None:
        self._results = results
        self._starting = starting
        self._override = override
        self._launcher = Launcher(starting.program)
        self._expanding = asyncio.Lock()

    def offered(self, _: Request) -> Response:
        """The document that can be run, or why there is none; reads only its `runs`."""
        document = self._starting.document
        return Data(
            Offer(
                document=None if document is None else str(document),
                runs=0 if document is None else _runs(document),
                refusal=self._starting.refusal,
                repeat=bool(self._starting.program),
            )
        )

    async def expanded(self, _: Request) -> Response:
        """The document's configurations, expanded in a separate process: plugins are executed."""
        words = expansion_words(self._document())
        async with self._expanding:
            said = await _output([*self._starting.program, *words])
        return Data(columns([_variant(item) for item in json.loads(said)]).variants)

    def started(self, request: Request) -> Response:
        """Start the document's campaign."""
        choices = read_choices(request.query_params)
        return self.start(run_words(self._document(), self._results, choices))

    def repeated(self, request: Request) -> Response:
        """Reproduce a run."""
        asked = request.query_params
        campaign, variant, run = (asked.get(key, "") for key in ("campaign", "variant", "run"))
        place = f"{campaign}/{variant}/{run}"
        words = repeat_words(self._results, place, run_record(self._results, place))
        if not words:
            raise InputError(f"The runtime of {variant}/{run} of {campaign} is unknown.")
        return self.start(words, campaign, run=f"{variant}/{run}")

    def stopped(self, _: Request) -> Response:
        """Ask the task to end."""
        self._launcher.stop()
        return Data(self._launcher.launch)

    def news(self, known: News | None) -> News | None:
        """Changes since the known state; None if there are none."""
        launch = self._launcher.launch
        if launch is None:
            return None
        is_same = known is not None and known.launch.number == launch.number
        first, lines = self._launcher.output(known.end if known and is_same else 0)
        if known and known.launch == launch and not lines:
            return None
        return News(launch, first, lines)

    def end(self) -> None:
        """Stop the task and wait for its end."""
        launch = self._launcher.launch
        if launch is not None and launch.ended is None:
            self._starting.message("Stopping the campaign that was started from the page …")
            self._launcher.end()

    def _document(self) -> Path:
        if self._starting.document is None:
            raise CannotRunError(self._starting.refusal)
        return self._starting.document

    def start(
        self, words: Sequence[str], campaign: str = "", makes: str = "", run: str = ""
    ) -> Response:
        """Start a command that executes runs.

        Args:
            words: its arguments.
            campaign: the campaign on whose page it is started, if any.
            makes: the campaign that gets the runs, if it exists.
            run: `<variant>/<number>` of the run that is reproduced, if any.

        Raises:
            CannotRunError: nothing can be started from here.
        """
        if not self._starting.program:
            raise CannotRunError(self._starting.refusal)
        then = postprocessing_words(self._results, self._override)
        then = then if self._starting.postprocess else []
        return Data(self._launcher.start(words, then, campaign, makes, run))


def _runs(document: Path) -> int:
    """Runs of each configuration according to a document, at most, if it is valid."""
    try:
        data = mapping(parse_yaml(read_content(document)))
    except InputError:
        return 1
    runs = mapping(data.get("execution")).get("runs")
    if isinstance(runs, Mapping):
        runs = runs.get("max", RunsAsNeeded.model_fields["max"].default)
    return runs if isinstance(runs, int) else 1


def _variant(item: Mapping[str, Any]) -> VariantRuns:
    try:
        parameters = mapping(plain(item["config"]))
    except ValueError:  # too large for the page
        parameters = {}
    return VariantRuns(str(item["name"]), str(item["_config_name"]), parameters, ())


async def _output(words: Sequence[str]) -> bytes:
    """The output of a command.

    Raises:
        InputError: the command fails; the message contains its output.
    """
    try:
        process = await asyncio.create_subprocess_exec(
            *words, stdin=DEVNULL, stdout=PIPE, stderr=PIPE, start_new_session=True
        )
    except OSError as error:
        raise CannotRunError(f"{words[0]} cannot be started: {error}.") from None
    out, complaints = await _ended(process)
    if process.returncode:
        raise InputError(complaints.decode("utf-8", "replace").strip())
    return out


async def _ended(process: Process) -> tuple[bytes, bytes]:
    try:
        return await process.communicate()
    finally:
        if process.returncode is None:  # the server ends
            process.terminate()

"""Campaigns on a cluster while they run: in place on a terminal, as lines elsewhere."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from types import TracebackType
from typing import TYPE_CHECKING, Protocol, Self

from robovast_cli.kube.status import CampaignState, now
from robovast_cli.ui.listing import format_table
from robovast_cli.ui.output import say
from robovast_cli.ui.progress import clock_time

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

STEPS = 100
"""Into how many parts a campaign is divided: a line is printed for each at most."""


class View(Protocol):
    """Shows campaigns."""

    def update(self, campaigns: Sequence[CampaignState]) -> None:
        """Show how they are now."""


def follow_view() -> AbstractContextManager[View]:
    """A live view on a terminal, lines elsewhere."""
    if sys.stdout.isatty() and os.environ.get("TERM") != "dumb":
        return LiveCampaigns()
    return CampaignLines()


class CampaignLines:
    """Prints a line when something has changed that is worth one."""

    def __init__(self) -> None:
        self._said: dict[str, object] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        """Nothing to end."""

    def update(self, campaigns: Sequence[CampaignState]) -> None:
        """Print what is new."""
        for campaign in campaigns:
            runs = campaign.status.runs
            step = campaign.done * STEPS // max(runs.total, 1)
            bad = runs.failed + runs.errored
            mark = (campaign.status.state, step, min(bad, STEPS), runs.total, *campaign.messages)
            if self._said.get(campaign.name) != mark:
                self._said[campaign.name] = mark
                say(line(campaign))


def line(campaign: CampaignState) -> str:
    """A campaign in one line, what hinders it below."""
    left = campaign.left(now())
    rest = f", about {clock_time(left)} left" if left else ""
    text = f"{campaign.name}  {campaign.status.state}  {campaign.counts()}{rest}"
    return "\n".join([text, *(f"    {message}" for message in campaign.messages)])


def table(campaigns: Sequence[CampaignState]) -> str:
    """Campaigns as a table."""
    columns = [
        "CAMPAIGN",
        "STATE",
        "DONE",
        "PASSED",
        "FAILED",
        "ERRORED",
        "RUNNING",
        "WAITING",
        "TIME",
    ]
    text = format_table(columns, [_cells(campaign) for campaign in campaigns])
    notes = [f"{c.name}: {message}\n" for c in campaigns for message in c.messages]
    return "".join([text, *notes])


def _cells(campaign: CampaignState) -> list[str]:
    runs = campaign.status.runs
    elapsed = campaign.elapsed(now())
    return [
        campaign.name,
        campaign.status.state,
        f"{campaign.done}/{runs.total}",
        str(runs.passed),
        str(runs.failed),
        str(runs.errored),
        *(str(0 if campaign.finished else pods) for pods in (runs.active, runs.waiting)),
        "" if elapsed is None else clock_time(elapsed),
    ]


class LiveCampaigns:
    """A bar for each campaign, renewed in place."""

    def __init__(self, console: Console | None = None) -> None:
        from rich.console import Console
        from rich.live import Live

        self._campaigns: Sequence[CampaignState] = ()
        self._console = console or Console(highlight=False)
        self._live = Live(
            console=self._console,
            get_renderable=self.render,
            refresh_per_second=2,
            transient=False,
        )

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        """Give the terminal back."""
        self._live.stop()

    def update(self, campaigns: Sequence[CampaignState]) -> None:
        """Show them from now on."""
        self._campaigns = campaigns

    def render(self) -> RenderableType:
        """What is shown now."""
        from rich.console import Group
        from rich.table import Table
        from rich.text import Text

        if not self._campaigns:
            return Text("no campaigns", "dim")
        grid = Table.grid(padding=(0, 1))
        notes = []
        for campaign in self._campaigns:
            grid.add_row(*_row(campaign))
            notes += [Text(f"{campaign.name}: {m}", "yellow") for m in campaign.messages]
        return Group(grid, *notes)


def _row(campaign: CampaignState) -> list[RenderableType]:
    from rich.progress_bar import ProgressBar
    from rich.text import Text

    runs = campaign.status.runs
    styles = {"passed": "green", "failed": "red", "errored": "yellow"}
    counts = {"passed": runs.passed, "failed": runs.failed, "errored": runs.errored}
    parts = [Text(f"{count} {word}", styles[word]) for word, count in counts.items() if count]
    parts += [Text(text, "cyan") for text in campaign.pods()]
    return [
        Text(campaign.name),
        Text(campaign.status.state, "dim"),
        ProgressBar(
            total=max(runs.total, 1), completed=campaign.done, width=30, complete_style="cyan"
        ),
        Text(f"{campaign.done}/{runs.total}"),
        Text("  ").join(parts),
        Text(_times(campaign), "dim"),
    ]


def _times(campaign: CampaignState) -> str:
    elapsed, left = campaign.elapsed(now()), campaign.left(now())
    if elapsed is None:
        return ""
    return clock_time(elapsed) + (f", about {clock_time(left)} left" if left is not None else "")

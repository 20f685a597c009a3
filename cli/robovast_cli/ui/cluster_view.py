"""Views of running campaigns on a cluster: updated on a terminal, lines elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Protocol, Self

from robovast.base.printable import printable
from robovast_cli.kube.status import CampaignState, now
from robovast_cli.ui.live_view import LiveView, ProgressRow, clock_time, is_live
from robovast_cli.ui.output import echo
from robovast_cli.ui.table import format_table

STEPS = 100
"""Maximum number of lines for the progress of a campaign."""


class ClusterView(Protocol):
    """View of campaigns."""

    def update(self, campaigns: Sequence[CampaignState]) -> None:
        """Show the current state."""


def follow_view() -> AbstractContextManager[ClusterView]:
    """Return a live view on a terminal, lines elsewhere."""
    return LiveCampaigns() if is_live(sys.stdout) else CampaignLines()


class CampaignLines:
    """Prints a line when the state, the counts or the problems of a campaign change."""

    def __init__(self) -> None:
        self._printed: dict[str, object] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *how: object) -> None:
        """Do nothing."""

    def update(self, campaigns: Sequence[CampaignState]) -> None:
        """Print changes."""
        for campaign in campaigns:
            runs = campaign.status.runs
            step = campaign.done * STEPS // max(runs.needed, 1)
            bad = runs.failed + runs.errored
            mark = (campaign.status.state, step, min(bad, STEPS), runs.needed, *campaign.messages)
            if self._printed.get(campaign.name) != mark:
                self._printed[campaign.name] = mark
                echo(line(campaign))


def line(campaign: CampaignState) -> str:
    """Return a campaign in one line, with its problems below."""
    left = campaign.left(now())
    rest = f", about {clock_time(left)} left" if left else ""
    text = f"{campaign.name}  {campaign.status.state}  {campaign.counts()}{rest}"
    return "\n".join([text, *(f"    {message}" for message in campaign.messages)])


def table(campaigns: Sequence[CampaignState]) -> str:
    """Return a table of campaigns."""
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
    notes = [f"{c.name}: {note}\n" for c in campaigns for note in [*_found(c), *c.messages]]
    return "".join([text, *notes])


def _found(campaign: CampaignState) -> list[str]:
    decisions = printable(campaign.status.decisions) or campaign.not_needed()
    return list(filter(None, [campaign.search_counts(), decisions]))


def _cells(campaign: CampaignState) -> list[str]:
    runs = campaign.status.runs
    elapsed = campaign.elapsed(now())
    return [
        campaign.name,
        campaign.status.state,
        f"{campaign.done}/{runs.needed}",
        str(runs.passed),
        str(runs.failed),
        str(runs.errored),
        *(str(0 if campaign.finished else pods) for pods in (runs.active, runs.waiting)),
        "" if elapsed is None else clock_time(elapsed),
    ]


class LiveCampaigns(LiveView):
    """Shows a bar for each campaign."""

    def __init__(self) -> None:
        self._campaigns: Sequence[CampaignState] = ()
        super().__init__(lambda: [_standing(campaign) for campaign in self._campaigns])

    def update(self, campaigns: Sequence[CampaignState]) -> None:
        """Show these campaigns."""
        self._campaigns = campaigns


def _standing(campaign: CampaignState) -> ProgressRow:
    runs, at = campaign.status.runs, now()
    pods = {} if campaign.finished else {"running": runs.active, "waiting": runs.waiting}
    return ProgressRow(
        campaign.done,
        runs.needed,
        {"passed": runs.passed, "failed": runs.failed, "errored": runs.errored, **pods},
        campaign.elapsed(at),
        campaign.left(at),
        campaign.name,
        campaign.status.state,
        [
            *((f"{campaign.name}: {found}", "") for found in _found(campaign)),
            *((f"{campaign.name}: {message}", "yellow") for message in campaign.messages),
        ],
    )

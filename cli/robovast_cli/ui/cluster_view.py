"""Campaigns on a cluster while they run: in place on a terminal, as lines elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Protocol, Self

from robovast.base.printable import printable
from robovast_cli.kube.status import CampaignState, now
from robovast_cli.ui.live_view import LiveView, Standing, clock_time, is_live
from robovast_cli.ui.output import echo
from robovast_cli.ui.table import format_table

STEPS = 100
"""Into how many parts a campaign is divided: a line is printed for each at most."""


class ClusterView(Protocol):
    """Shows campaigns."""

    def update(self, campaigns: Sequence[CampaignState]) -> None:
        """Show how they are now."""


def follow_view() -> AbstractContextManager[ClusterView]:
    """A live view on a terminal, lines elsewhere."""
    return LiveCampaigns() if is_live(sys.stdout) else CampaignLines()


class CampaignLines:
    """Prints a line when something has changed that is worth one."""

    def __init__(self) -> None:
        self._said: dict[str, object] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *how: object) -> None:
        """Nothing to end."""

    def update(self, campaigns: Sequence[CampaignState]) -> None:
        """Print changes."""
        for campaign in campaigns:
            runs = campaign.status.runs
            step = campaign.done * STEPS // max(runs.needed, 1)
            bad = runs.failed + runs.errored
            mark = (campaign.status.state, step, min(bad, STEPS), runs.needed, *campaign.messages)
            if self._said.get(campaign.name) != mark:
                self._said[campaign.name] = mark
                echo(line(campaign))


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
    notes = [f"{c.name}: {note}\n" for c in campaigns for note in [*_found(c), *c.messages]]
    return "".join([text, *notes])


def _found(campaign: CampaignState) -> list[str]:
    told = [campaign.search_counts(), printable(campaign.status.decisions) or campaign.spared()]
    return [found for found in told if found]


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
    """A bar for each campaign, renewed in place."""

    def __init__(self) -> None:
        self._campaigns: Sequence[CampaignState] = ()
        super().__init__(lambda: [_standing(campaign) for campaign in self._campaigns])

    def update(self, campaigns: Sequence[CampaignState]) -> None:
        """Show them from now on."""
        self._campaigns = campaigns


def _standing(campaign: CampaignState) -> Standing:
    runs, at = campaign.status.runs, now()
    pods = {} if campaign.finished else {"running": runs.active, "waiting": runs.waiting}
    return Standing(
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

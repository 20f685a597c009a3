"""What the server answers; `web/src/api-types.ts` is generated from these types.

The fields of most answers are defined where they are computed; this module has the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robovast.campaign.verdict import Verdict
from robovast.evaluation.campaign_inputs import About, Change
from robovast.evaluation.columns import CampaignColumns
from robovast.evaluation.compare import Comparison
from robovast.evaluation.factors import Explained
from robovast.evaluation.history import History
from robovast.evaluation.launch.cluster_commands import ClusterCommand
from robovast.evaluation.log_search import FoundRun
from robovast.evaluation.logs import LogPage
from robovast.evaluation.notebooks.runner import NotebookResult
from robovast.evaluation.run import RunDetails, Timeline
from robovast.evaluation.server.launches import News, Offer
from robovast.evaluation.server.notebooks import NotebookEntry
from robovast.evaluation.server.preparing import Prepared
from robovast.evaluation.summaries import ActiveJob, CampaignSummary
from robovast.evaluation.tables import Table, Usage


@dataclass(frozen=True)
class Campaigns:
    """All campaigns, the newest first."""

    results: str
    campaigns: dict[str, CampaignSummary | None]
    """None for a campaign that has not been read yet."""
    faults: dict[str, str]
    """Why campaigns cannot be read."""


@dataclass(frozen=True, kw_only=True)
class Columns(CampaignColumns):
    """A campaign with all its runs."""

    summary: CampaignSummary
    reading: tuple[int, int] | None
    """How many configurations are read so far, and of how many; None if all are."""
    active: Sequence[ActiveJob]
    search: bool
    """Whether a search proposed its runs."""
    resume: str
    """Command that executes what is missing; empty when there is none."""
    wider: str
    """Why intervals are wider than those of a fixed number of runs; empty if they are not."""


@dataclass(frozen=True, kw_only=True)
class Factors(Explained):
    """The factors of a campaign, and which of them separate failures."""

    version: int
    """Of the campaign."""


@dataclass(frozen=True)
class MetricColumns:
    """Columns with numbers, by table."""

    columns: dict[str, list[str]]
    same: dict[str, list[str]]
    """Those that have one value everywhere."""


@dataclass(frozen=True)
class RunResult:
    """A run in the list of runs."""

    verdict: Verdict
    reason: str


@dataclass(frozen=True)
class RunAnswer:
    """A run, and all runs of its configuration."""

    version: int
    """Of the campaign."""
    details: RunDetails
    siblings: Sequence[tuple[int, Verdict, float | None]]
    """Number, verdict and start [s since the epoch] of the runs of its configuration."""
    result: RunResult | None
    """None while the run is not in the list yet."""


@dataclass(frozen=True)
class MoreRuns:
    """What gives configurations of a campaign more runs."""

    version: int
    command: str
    """Empty for a search, which has batches, and for a campaign of a cluster."""
    cluster: ClusterCommand | None
    """The parts of the command for a campaign of a cluster."""
    planned: int
    """Runs of the configuration with most runs, including those that are still to come."""
    widen: bool
    """Whether more runs make intervals wider than they are."""


@dataclass(frozen=True)
class Compared:
    """A campaign compared with an earlier one."""

    name: str
    comparison: Comparison


ANSWERS = (
    Campaigns,
    Columns,
    About,
    Change,
    Factors,
    MetricColumns,
    RunAnswer,
    MoreRuns,
    Compared,
    History,
    LogPage,
    FoundRun,
    Table,
    Usage,
    Timeline,
    Offer,
    News,
    Prepared,
    NotebookEntry,
    NotebookResult,
)
"""Types of answers; types of their fields follow."""

"""What follows the commands: tables, metadata and graph, where anything changed since."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from robovast import __version__
from robovast.errors import RobovastError
from robovast.postprocessing.content import combined
from robovast.postprocessing.events import CampaignSummary, Failure, Observer, Options
from robovast.postprocessing.state import State, Unit
from robovast.postprocessing.survey import WHOLE


def finish(
    campaign: Path,
    state: State,
    units: Mapping[str, Unit],
    options: Options,
    observer: Observer,
    summary: CampaignSummary,
) -> None:
    """Write what is made of a whole campaign, where it is not up to date.

    Args:
        campaign: its folder.
        state: remembers of which files each was made.
        units: of the campaign, after all commands.
        options: say what to leave out.
        observer: is told.
        summary: takes failures.
    """
    now = combined({path: unit.signature for path, unit in units.items() if path != WHOLE})
    now = f"{__version__} {now}"
    if not options.skip_metadata and (
        options.force or state.note("metadata") != now or not (campaign / "metadata.yaml").exists()
    ):
        observer.step_started("metadata and provenance graph", 1)
        if _succeeded(lambda: _describe(campaign), "metadata", observer, summary):
            state.set_note("metadata", now)
        observer.step_advanced()


def _succeeded(
    work: Callable[[], None], name: str, observer: Observer, summary: CampaignSummary
) -> bool:
    try:
        work()
    except RobovastError as error:
        failure = Failure(summary.campaign.name, name, "", str(error))
        summary.failures.append(failure)
        observer.failed(failure)
        return False
    return True


def _describe(campaign: Path) -> None:
    from robovast.provenance import describe

    describe(campaign)

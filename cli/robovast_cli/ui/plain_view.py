"""Lines for logs and pipes: few enough to be read after ten thousand runs."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.model.plan import Run
from robovast_cli.ui.output import say
from robovast_cli.ui.progress import Progress, clock_time

MOST_LINES = 100
"""Up to this many runs every one has a line; of more, each that did not pass, and a count for
every hundredth part."""


class PlainView(Progress):
    """Prints a line for what happens."""

    def __enter__(self) -> PlainView:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        """Nothing to end."""

    def campaign_started(self, campaign: Path, total: int, done: int, how: str) -> None:
        """Say what begins."""
        super().campaign_started(campaign, total, done, how)
        say(self.title)

    def run_finished(self, run: Run, record: RunRecord) -> None:
        """Say how a run ended, when that is worth a line."""
        super().run_finished(run, record)
        place = f"[{self.done:>{len(str(self.total))}}/{self.total}]"
        if record.verdict is not Verdict.PASSED:
            say(f"{place} {record.verdict:<7} {run.path}: {record.reason}")
        elif self.total <= MOST_LINES:
            say(f"{place} {record.verdict:<7} {run.path}  {record.duration:.1f} s")
        if (
            self.total > MOST_LINES
            and self.done * 100 // self.total > (self.done - 1) * 100 // self.total
        ):
            say(f"{self.counts()}{self._left()}")

    def message(self, text: str) -> None:
        """Print it."""
        say(text)

    def _left(self) -> str:
        return f", about {clock_time(self.left)} left" if self.left else ""

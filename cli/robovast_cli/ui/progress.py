"""What is known of a campaign while it runs."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.model.plan import Run
from robovast_cli.workspace import shown


class Progress:
    """Counts of a campaign's runs; an `Observer` whose messages and ends others show."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.total = 0
        self.done_before = 0
        self.verdicts: Counter[Verdict] = Counter()
        self.running: dict[int, str] = {}
        """Names of the runs in progress, by id, the oldest first."""
        self.title = ""
        self._clock = clock
        self._started = clock()

    @property
    def done(self) -> int:
        """Runs that ended, those of earlier sessions included."""
        return self.done_before + self.verdicts.total()

    @property
    def elapsed(self) -> float:
        """Time since the first run could start [s]."""
        return self._clock() - self._started

    @property
    def left(self) -> float | None:
        """Time until the last run ends, at the pace so far [s]; None before the first has."""
        ended = self.verdicts.total()
        return self.elapsed / ended * (self.total - self.done) if ended else None

    def campaign_started(self, campaign: Path, total: int, done: int, how: str) -> None:
        """Begin to count."""
        self.total, self.done_before = total, done
        self._started = self._clock()
        noun = "run" if total == 1 else "runs"
        before = f", {done} of them finished before" if done else ""
        self.title = f"{total} {noun}{before}, {how}, into {shown(campaign)}"

    def run_started(self, run: Run) -> None:
        """A run began."""
        self.running[run.id] = run.path

    def run_finished(self, run: Run, record: RunRecord) -> None:
        """A run ended."""
        self.running.pop(run.id, None)
        self.verdicts[record.verdict] += 1

    def counts(self) -> str:
        """`12 of 260 done: 4 before, 7 passed, 1 failed`."""
        before = [f"{self.done_before} before"] if self.done_before else []
        parts = [*before, *(f"{self.verdicts[v]} {v}" for v in Verdict if self.verdicts[v])]
        return f"{self.done} of {self.total} done" + (f": {', '.join(parts)}" if parts else "")


def clock_time(seconds: float) -> str:
    """`1:02:03` or `2:03`."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"

"""A campaign on this machine while it runs: in place on a terminal, as lines elsewhere."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Self

from robovast.campaign.decisions import describe_decision
from robovast.campaign.failure_groups import cause_key
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.execution.local.pack_queue import Decided
from robovast.model.plan import Run
from robovast_cli.ui.live_view import LiveView, Standing, clock_time
from robovast_cli.ui.output import echo
from robovast_cli.workspace import shown

MOST_LINES = 100
"""Up to this many runs every one has a line where nothing is renewed in place; otherwise each new
cause of failure has one, and of more runs every hundredth part a count."""
MOST_RUNNING = 8
"""Running runs that are named at most."""


class LocalView:
    """Counts a campaign's runs, and shows them; each new cause of failure has a line of its own.

    Args:
        make_live: makes what renews itself in place; without it there are lines alone.
        clock: the time [s].
    """

    def __init__(
        self,
        make_live: Callable[[Callable[[], Sequence[Standing]]], LiveView] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.total = 0
        self.done_before = 0
        self.verdicts: Counter[Verdict] = Counter()
        self.reused = 0
        self._causes: set[str] = set()
        self.running: dict[int, str] = {}
        """Names of the runs in progress, by id, the oldest first."""
        self._clock = clock
        self._started = clock()
        self._live = make_live(self.look) if make_live else None

    def __enter__(self) -> Self:
        if self._live:
            self._live.__enter__()
        return self

    def __exit__(self, *how: object) -> None:
        """Give the terminal back."""
        if self._live:
            self._live.__exit__(*how)

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
        executed = self.verdicts.total() - self.reused
        return self.elapsed / executed * (self.total - self.done) if executed else None

    def look(self) -> list[Standing]:
        """The progress of the campaign."""
        counts = {str(verdict): self.verdicts[verdict] for verdict in Verdict}
        state = "" if self.total else "preparing …"
        names = list(self.running.values())
        more = f" and {len(names) - MOST_RUNNING} more" if len(names) > MOST_RUNNING else ""
        running = f"running: {', '.join(names[:MOST_RUNNING])}{more}" if names else ""
        notes = [(running, "dim")]
        if self.reused:
            notes.append((f"reused {self.reused} of {self.total}", "dim"))
        return [Standing(self.done, self.total, counts, self.elapsed, self.left, "", state, notes)]

    def campaign_started(self, campaign: Path, total: int, done: int, how: str) -> None:
        """Say what begins, and begin to count; 0 runs are some that only follow."""
        self.total, self.done_before = total, done
        self._started = self._clock()
        noun = "run" if total == 1 else "runs"
        before = f", {done} already finished" if done else ""
        runs = f"{total} {noun}{before}, " if total else ""
        self.message(f"{runs}{how}, into {shown(campaign)}")

    def runs_added(self, count: int) -> None:
        """Count runs that are added to the campaign."""
        self.total += count

    def run_started(self, run: Run) -> None:
        """A run began."""
        self.running[run.id] = run.path

    def run_finished(self, run: Run, record: RunRecord) -> None:
        """Say how a run ended, when that is worth a line."""
        self.running.pop(run.id, None)
        self.verdicts[record.verdict] += 1
        self.reused += bool(record.reused_from)
        passed = record.verdict is Verdict.PASSED
        how = f"  {record.duration:.1f} s" if passed else f": {record.reason}"
        how += f" (reused from {record.reused_from})" if record.reused_from else ""
        line = f"{record.verdict:<7} {run.path}{how}"
        is_new = not passed and self._is_new(record.reason)
        if self._live:
            if is_new:
                self._live.print_line(line, str(record.verdict))
            return
        if is_new or self.total <= MOST_LINES:
            echo(f"[{self.done:>{len(str(self.total))}}/{self.total}] {line}")
        steps = [done * 100 // self.total for done in (self.done - 1, self.done)]
        if self.total > MOST_LINES and steps[0] < steps[1]:
            echo(f"{self._counts()}{f', about {clock_time(self.left)} left' if self.left else ''}")

    def _is_new(self, reason: str) -> bool:
        """Whether no earlier run had this cause; the summary counts the others."""
        known = len(self._causes)
        self._causes.add(cause_key(reason))
        return len(self._causes) > known

    def configuration_decided(self, decided: Decided) -> None:
        """Say what it is, and count the runs that are left no more."""
        self.total -= decided.spared
        self.message(f"{decided.variant}: {describe_decision(decided.decision)} runs")

    def message(self, text: str) -> None:
        """Leave a line."""
        if self._live:
            self._live.print_line(text)
        else:
            echo(text)

    def _counts(self) -> str:
        """`12 of 260 done: 4 before, 7 passed, 1 failed`."""
        before = [f"{self.done_before} before"] if self.done_before else []
        parts = [*before, *(f"{self.verdicts[v]} {v}" for v in Verdict if self.verdicts[v])]
        parts += [f"{self.reused} of them reused"] if self.reused else []
        return f"{self.done} of {self.total} done" + (f": {', '.join(parts)}" if parts else "")

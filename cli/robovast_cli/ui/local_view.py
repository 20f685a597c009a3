"""View of a running campaign on this machine: updated on a terminal, lines elsewhere."""

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
from robovast_cli.ui.live_view import LiveView, ProgressRow, clock_time
from robovast_cli.ui.output import echo
from robovast_cli.ui.table import counted
from robovast_cli.workspace import shown

MOST_LINES = 100
"""Maximum number of runs with a line each, without a live view. A larger campaign has a line for
each new cause of failure, and for each percent of its runs."""
MOST_RUNNING = 8
"""Maximum number of running runs that are named."""


class LocalView:
    """Shows the progress of a campaign; each new cause of failure has a separate line.

    Args:
        make_live: creates a view that is updated in place (default: only lines).
        clock: returns the time [s].
    """

    def __init__(
        self,
        make_live: Callable[[Callable[[], Sequence[ProgressRow]]], LiveView] | None = None,
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
        self._live = make_live(self.progress) if make_live else None

    def __enter__(self) -> Self:
        if self._live:
            self._live.__enter__()
        return self

    def __exit__(self, *how: object) -> None:
        """Release the terminal."""
        if self._live:
            self._live.__exit__(*how)

    @property
    def done(self) -> int:
        """Finished runs, including runs of earlier sessions."""
        return self.done_before + self.verdicts.total()

    @property
    def elapsed(self) -> float:
        """Time since the first run could start [s]."""
        return self._clock() - self._started

    @property
    def left(self) -> float | None:
        """Estimated remaining time [s]; None before the first run has finished."""
        executed = self.verdicts.total() - self.reused
        return self.elapsed / executed * (self.total - self.done) if executed else None

    def progress(self) -> list[ProgressRow]:
        """Return the progress of the campaign."""
        counts = {str(verdict): self.verdicts[verdict] for verdict in Verdict}
        state = "" if self.total else "preparing …"
        names = list(self.running.values())
        more = f" and {len(names) - MOST_RUNNING} more" if len(names) > MOST_RUNNING else ""
        running = f"running: {', '.join(names[:MOST_RUNNING])}{more}" if names else ""
        notes = [(running, "dim")]
        if self.reused:
            notes.append((f"reused {self.reused} of {self.total}", "dim"))
        return [
            ProgressRow(self.done, self.total, counts, self.elapsed, self.left, "", state, notes)
        ]

    def campaign_started(self, campaign: Path, total: int, done: int, how: str) -> None:
        """Print the number of runs (0: unknown) and the runtime, and start to count."""
        self.total, self.done_before = total, done
        self._started = self._clock()
        before = f", {done} already finished" if done else ""
        runs = f"{counted(total, 'run')}{before}, " if total else ""
        self.message(f"{runs}{how}, into {shown(campaign)}")

    def runs_added(self, count: int) -> None:
        """Count runs that are added to the campaign."""
        self.total += count

    def run_started(self, run: Run) -> None:
        """Add a running run."""
        self.running[run.id] = run.path

    def run_finished(self, run: Run, record: RunRecord) -> None:
        """Count a finished run, and print a line if necessary."""
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
        """Return whether no earlier run had this cause."""
        known = len(self._causes)
        self._causes.add(cause_key(reason))
        return len(self._causes) > known

    def configuration_decided(self, decided: Decided) -> None:
        """Print a decision, and subtract the runs that are not needed."""
        self.total -= decided.spared
        self.message(f"{decided.variant}: {describe_decision(decided.decision)} runs")

    def message(self, text: str) -> None:
        """Print a permanent line."""
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

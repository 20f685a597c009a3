"""A view of a running campaign that renews itself in place, for terminals."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from robovast.base.printable import printable
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.model.plan import Run
from robovast_cli.ui.progress import Progress, clock_time

MOST_RUNNING = 8
"""Running runs that are named at most."""

_STYLES = {
    Verdict.PASSED: "green",
    Verdict.FAILED: "red",
    Verdict.ERRORED: "yellow",
    Verdict.INTERRUPTED: "dim",
}


class LiveView(Progress):
    """Shows counts, what runs and the time left; runs that do not pass stay as lines above."""

    def __init__(self, console: Console | None = None) -> None:
        super().__init__()
        self._console = console or Console(highlight=False)
        self._live = Live(
            console=self._console,
            get_renderable=self.render,
            refresh_per_second=4,
            transient=True,
        )

    def __enter__(self) -> LiveView:
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

    def campaign_started(self, campaign: Path, total: int, done: int, how: str) -> None:
        """Begin to show."""
        super().campaign_started(campaign, total, done, how)
        self._console.print(Text(self.title))

    def run_finished(self, run: Run, record: RunRecord) -> None:
        """Leave a line when the run did not pass."""
        super().run_finished(run, record)
        if record.verdict is not Verdict.PASSED:
            line = Text(f"{record.verdict:<7} ", _STYLES[record.verdict])
            self._console.print(line.append(f"{run.path}: {printable(record.reason)}", "default"))

    def message(self, text: str) -> None:
        """Leave a line."""
        self._console.print(Text(printable(text)))

    def render(self) -> RenderableType:
        """What is shown now."""
        if not self.title:
            return Text(f"preparing … {clock_time(self.elapsed)}", "dim")
        bar = Table.grid(padding=(0, 1))
        bar.add_row(
            ProgressBar(
                total=max(self.total, 1), completed=self.done, width=30, complete_style="cyan"
            ),
            f"{self.done}/{self.total}",
            self._counts(),
            Text(self._times(), "dim"),
        )
        names = list(self.running.values())
        more = f" and {len(names) - MOST_RUNNING} more" if len(names) > MOST_RUNNING else ""
        running = Text(f"running: {', '.join(names[:MOST_RUNNING])}{more}" if names else "", "dim")
        return Group(bar, running)

    def _counts(self) -> Text:
        pairs = [(f"{count} {verdict}", _STYLES[verdict]) for verdict, count in self._seen()]
        return Text("  ").join(Text(text, style) for text, style in pairs)

    def _seen(self) -> list[tuple[Verdict, int]]:
        return [(verdict, self.verdicts[verdict]) for verdict in Verdict if self.verdicts[verdict]]

    def _times(self) -> str:
        left = f", about {clock_time(self.left)} left" if self.left is not None else ""
        return f"{clock_time(self.elapsed)}{left}"

"""Shows the progress of campaigns, updated in place on a terminal."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self, TextIO

from robovast.base.printable import printable

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.text import Text

STYLES = {
    "passed": "green",
    "failed": "red",
    "errored": "yellow",
    "interrupted": "dim",
    "running": "cyan",
    "waiting": "cyan",
}
WIDEST_BAR = 30
"""[characters]"""


@dataclass(frozen=True)
class ProgressRow:
    """The progress of a campaign."""

    done: int
    total: int
    counts: Mapping[str, int]
    """Numbers of runs by verdict, and of running and waiting pods; 0 is not shown."""
    elapsed: float | None
    """[s]"""
    left: float | None
    """Estimated remaining time [s]."""
    name: str = ""
    state: str = ""
    notes: Sequence[tuple[str, str]] = ()
    """Lines below all campaigns, each with its style."""

    @property
    def times(self) -> str:
        """`2:03, about 0:40 left`."""
        if self.elapsed is None:
            return ""
        left = f", about {clock_time(self.left)} left" if self.left is not None else ""
        return f"{clock_time(self.elapsed)}{left}"


class LiveView:
    """Shows a bar, counts and times of each campaign, below permanent lines.

    Args:
        read: returns the progress of the campaigns.
        transient: remove the bars at the end.
        console: console of the bars (default: standard output).
    """

    def __init__(
        self,
        read: Callable[[], Sequence[ProgressRow]],
        *,
        transient: bool = False,
        console: Console | None = None,
    ) -> None:
        from rich.console import Console
        from rich.live import Live

        self._read = read
        self._console = console or Console(highlight=False)
        self._live = Live(
            console=self._console,
            get_renderable=self.render,
            refresh_per_second=4,
            transient=transient,
        )

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(self, *how: object) -> None:
        """Release the terminal."""
        self._live.stop()

    def print_line(self, line: str, word: str = "") -> None:
        """Print a permanent line, whose first word has its style."""
        from rich.text import Text

        text = Text(printable(line))
        text.stylize(STYLES.get(word, ""), 0, len(word))
        self._console.print(text)

    def render(self) -> RenderableType:
        """Return the current display."""
        from rich.console import Group
        from rich.text import Text

        campaigns = self._read()
        if not campaigns:
            return Text("no campaigns", "dim")
        notes = (note for campaign in campaigns for note in campaign.notes)
        lines = (_line((printable(text), style)) for text, style in notes)
        widest = min(WIDEST_BAR, self._console.width // 5)
        parts = (part for campaign in campaigns for part in _parts(campaign, widest))
        return Group(*parts, *lines)


def _parts(campaign: ProgressRow, widest: int) -> Iterator[RenderableType]:
    """Yield the name of a campaign, if any, and its progress bar, if it has runs."""
    from rich.progress_bar import ProgressBar
    from rich.table import Table
    from rich.text import Text

    titled = bool(campaign.name or campaign.state)
    if titled:
        yield _line((campaign.name, ""), (campaign.state, "dim"), (campaign.times, "dim"))
    if campaign.total:
        counts = [_line((f"{n} {word}", STYLES[word])) for word, n in campaign.counts.items() if n]
        bar = Table.grid(padding=(0, 1))
        bar.add_column(max_width=widest)
        bar.add_row(
            ProgressBar(campaign.total, campaign.done, complete_style="cyan"),
            _line((f"{campaign.done}/{campaign.total}", "")),
            Text("  ").join(counts),
            _line(("" if titled else campaign.times, "dim")),
        )
        yield bar


def _line(*parts: tuple[str, str]) -> Text:
    """Return one line, which is cut to the width of the terminal."""
    from rich.text import Text

    texts = [Text(text, style) for text, style in parts if text]
    line = Text("  ", no_wrap=True, overflow="ellipsis").join(texts)
    line.no_wrap, line.overflow = True, "ellipsis"
    return line


def is_live(stream: TextIO) -> bool:
    """Return whether output can be updated in place."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def clock_time(seconds: float) -> str:
    """`1:02:03` or `2:03`."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"

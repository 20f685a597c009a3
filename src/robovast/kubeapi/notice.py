"""Notices about a campaign to people: the operator writes a notice, and a Job sends it.

A notice as JSON is what a webhook gets, with two texts for people: `title` and `text`, the key
that Slack, Mattermost and others of their kind show.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from robovast.base.statistics import anytime, interval_text, percent, wilson
from robovast.kubeapi.resources import Notification
from robovast.kubeapi.status import Lenient, Runs, SearchStatus

NOTICE_VARIABLE = "ROBOVAST_NOTICE"
"""Variable of the Job's pods with an `Order`."""

Event = Literal["Finished", "GivenUp", "Stalled", "Recovered", "Started", "Batch", "Progress"]

_LONGEST_TEXT = 3500
"""ntfy makes a file of what is longer than 4096 bytes [byte]."""
_MOST_NAMED = 5


class Named(Lenient):
    """The campaign that a notice is about."""

    namespace: str
    name: str
    """Of the Campaign."""
    uid: str
    results: str = ""
    """Name of the results folder."""
    bucket: str = ""
    """Bucket of the results."""


class Notice(Lenient):
    """One thing that happened to a campaign."""

    version: Literal[1] = 1
    """Version of this format; it changes when a key changes its meaning or is removed."""
    id: str
    """Identifies the notice; it stays the same when the notice is sent again."""
    event: Event
    time: str
    """When it was noticed (ISO 8601, UTC)."""
    campaign: Named
    verdict: Literal["Passed", "Failed"] | None = None
    """None while the campaign is not over."""
    runs: Runs = Field(default_factory=Runs)
    failing: list[str] = Field(default_factory=list)
    """First bad runs by results folder."""
    search: SearchStatus | None = None
    """How far its search is, where the document has one."""
    seconds: float | None = None
    """How long the campaign has taken so far [s]."""
    reason: str = ""
    """CamelCase reason."""
    message: str = ""
    """The cause, and the remedy."""

    @property
    def title(self) -> str:
        """What happened, in a few words of ASCII."""
        name = self.campaign.name
        match self.event:
            case "Finished":
                return f"{name} has passed" if self.verdict == "Passed" else f"{name} has failed"
            case "GivenUp":
                return f"{name} was aborted: {self.reason}"
            case "Stalled":
                return f"{name} needs help: {self.reason}"
            case "Recovered":
                return f"{name} continues"
            case "Started":
                return f"{name} has started"
            case "Batch":
                scored = self.search.batch if self.search else 0
                return f"{name}: batch {scored - 1} is scored"
            case "Progress":
                return f"{name}: {self.runs.decided} of {self.runs.total} runs are done"

    @property
    def text(self) -> str:
        """What happened, and the remedy, in at most 3500 bytes."""
        campaign = f"-n {self.campaign.namespace} -i {self.campaign.name}"
        over = self.event in {"Finished", "GivenUp"}
        then = f"vast results download {campaign}" if over else "vast exec cluster monitor"
        why = _cut(self.message, _LONGEST_TEXT // 2)
        rate = "" if self.event == "Started" else self._rate()
        lines = [self._numbers(), rate, self._found(), why, self._failing(), then]
        return _cut("\n".join(filter(None, lines)), _LONGEST_TEXT)

    def payload(self) -> dict[str, Any]:
        """The notice as a webhook gets it."""
        data: dict[str, Any] = self.model_dump(by_alias=True, mode="json")
        return {**data, "title": self.title, "text": f"{self.title}\n{self.text}"}

    def _numbers(self) -> str:
        runs = self.runs
        if not runs.total:
            return ""
        counts = f"{runs.passed} passed, {runs.failed} failed, {runs.errored} errored"
        counts += f", {runs.not_needed} not needed" if runs.not_needed else ""
        took = "" if self.seconds is None else f" after {_duration(self.seconds)}"
        return f"{runs.total} runs: {counts}{took}"

    def _found(self) -> str:
        """How far a search is, and the best that it has found."""
        if self.search is None:
            return ""
        best = f"best {self.search.best}" if self.search.best else ""
        return " | ".join(filter(None, [self.search.criteria, best]))

    def _rate(self) -> str:
        """How often runs do not pass; the interval holds anytime if they are not all over."""
        decided, bad = self.runs.decided, self.runs.failed + self.runs.errored
        if not decided:
            return ""
        interval = wilson if decided == self.runs.total else anytime
        told = interval_text(interval(bad, decided))
        return f"{percent(bad / decided)} did not pass (95 % interval {told})"

    def _failing(self) -> str:
        named = self.failing[:_MOST_NAMED]
        more = " …" if len(self.failing) > len(named) else ""
        return f"Not passed: {', '.join(named)}{more}" if named else ""


class Order(Lenient):
    """The notice and receivers of a Job; its pod N sends to the N-th receiver."""

    notice: Notice
    receivers: list[Notification]


def _duration(seconds: float) -> str:
    """`2 h 5 min`, `5 min`, `12 s`."""
    minutes = int(seconds) // 60
    if minutes < 1:
        return f"{int(seconds)} s"
    hours = f"{minutes // 60} h " if minutes >= 60 else ""
    return f"{hours}{minutes % 60} min"


def _cut(text: str, limit: int) -> str:
    """Cut a text to a number of bytes in UTF-8."""
    if len(text.encode()) <= limit:
        return text
    return text.encode()[: limit - 3].decode(errors="ignore") + "…"

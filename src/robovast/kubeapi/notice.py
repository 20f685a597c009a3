"""Notices about a campaign to people: the operator writes a notice, and a Job sends it.

A notice as JSON is what a webhook gets, with two texts for people: `title` and `text`, the key
that Slack, Mattermost and others of their kind show.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field
from pydantic.alias_generators import to_camel

from robovast.base import docstrings
from robovast.base.statistics import anytime, interval_text, percent, wilson
from robovast.kubeapi.resources import Notification
from robovast.kubeapi.status import Runs

NOTICE_VARIABLE = "ROBOVAST_NOTICE"
"""Variable of the Job's pods with an `Order`."""

Event = Literal["Finished", "GivenUp", "Stalled", "Recovered"]

_LONGEST_TEXT = 3500
"""ntfy makes a file of what is longer than 4096 bytes [byte]."""
_MOST_NAMED = 5


class _Model(BaseModel):
    model_config = ConfigDict(
        extra="ignore",
        frozen=True,
        use_attribute_docstrings=docstrings.READ,
        alias_generator=to_camel,
        populate_by_name=True,
    )


class Named(_Model):
    """The campaign that a notice is about."""

    namespace: str
    name: str
    """Of the Campaign."""
    uid: str
    results: str = ""
    """Name of the results folder."""
    bucket: str = ""
    """Bucket of the results."""


class Notice(_Model):
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
                return f"{name} was given up: {self.reason}"
            case "Stalled":
                return f"{name} needs help: {self.reason}"
            case "Recovered":
                return f"{name} goes on"

    @property
    def text(self) -> str:
        """What happened, and the remedy, in at most 3500 bytes."""
        campaign = f"-n {self.campaign.namespace} -i {self.campaign.name}"
        over = self.event in {"Finished", "GivenUp"}
        then = f"vast results download {campaign}" if over else "vast exec cluster monitor"
        why = _cut(self.message, _LONGEST_TEXT // 2)
        lines = [self._numbers(), self._rate() if over else "", why, self._failing(), then]
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
        took = "" if self.seconds is None else f" after {_duration(self.seconds)}"
        return f"{runs.total} runs: {counts}{took}"

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


class Order(_Model):
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

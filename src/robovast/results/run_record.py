"""`run.json`: what is known of one run, written last and atomically.

A run folder with a `run.json` is complete; one without is not to be trusted.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from robovast.plain import write_atomically
from robovast.results.layout import RUN_RECORD
from robovast.results.verdict import Verdict

SCHEMA = 1
"""Version of the record's format."""


@dataclass(frozen=True)
class RunRecord:
    """Identity, parameters, verdict and circumstances of one run."""

    campaign: str
    variant: str
    entry: str
    run: int
    id: int
    verdict: Verdict
    reason: str
    """Why it did not pass; empty when it did."""
    started_at: str
    """ISO 8601, UTC."""
    finished_at: str
    duration: float
    """[s]"""
    exit_code: int | None
    """Of the process that executed the scenario; None when it did not end by itself."""
    attempt: int
    job: str
    runtime: str
    image: str
    image_digest: str
    host: str
    parameters: dict[str, Any] = field(default_factory=dict)
    schema: int = SCHEMA

    @property
    def finished(self) -> bool:
        """True when the run need not be executed again."""
        return self.verdict is not Verdict.INTERRUPTED

    def write(self, folder: Path) -> None:
        """Write `run.json` into a run's folder."""
        write_atomically(folder / RUN_RECORD, self.to_json())

    def to_json(self) -> str:
        """The text of `run.json`."""
        return json.dumps(asdict(self), indent=1, default=str) + "\n"


def read_run_record(folder: Path) -> RunRecord | None:
    """The record in a run's folder; None when there is none, or none of this format."""
    try:
        return parse_run_record((folder / RUN_RECORD).read_bytes())
    except OSError:
        return None


def parse_run_record(text: str | bytes) -> RunRecord | None:
    """The record in the text of a `run.json`; None when it is none of this format."""
    try:
        data = json.loads(text)
        return RunRecord(**{**data, "verdict": Verdict(data["verdict"])})
    except (ValueError, TypeError, KeyError):
        return None

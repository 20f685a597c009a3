"""`failure_rate`: the share of failed runs among those with a verdict."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from robovast.campaign.verdict import Verdict
from robovast.search.extractor import (
    Extractor,
    ExtractResult,
    completed_run_dirs,
    verdict_of,
)

NAME = "failure_rate"


class FailureRate(Extractor):
    """Counts verdicts; has no parameters."""

    def __init__(self) -> None:
        super().__init__()

    def extract(self, config_dir: Path) -> ExtractResult:
        """Return the share of failed runs.

        Raises:
            ValueError: no run came to a verdict.
        """
        return ExtractResult({NAME: failure_rate(config_dir)})

    @classmethod
    def names(cls, params: dict[str, Any]) -> frozenset[str]:
        """Its only number."""
        del params
        return frozenset({NAME})


def failure_rate(config_dir: Path) -> float:
    """The share of failed runs of a set.

    Raises:
        ValueError: no run came to a verdict.
    """
    verdicts = [verdict_of(run) for run in completed_run_dirs(config_dir)]
    if not verdicts:
        raise ValueError("no run came to a verdict")
    return verdicts.count(Verdict.FAILED) / len(verdicts)

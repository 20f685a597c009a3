"""The base class of extractors, which turn the runs of a parameter set into numbers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robovast.campaign.layout import Layout
from robovast.campaign.run_record import read_run_record
from robovast.campaign.verdict import Verdict, read_test_result

_EVIDENCE = {Verdict.PASSED, Verdict.FAILED}


@dataclass
class ExtractResult:
    """Numbers about a parameter set."""

    objectives: dict[str, float]
    measures: dict[str, float] = field(default_factory=dict)


class Extractor(ABC):
    """Turns the runs of a parameter set into objectives and measures.

    Args:
        params: `extract.params` of the document.
    """

    def __init__(self, **params: Any) -> None:
        self.params = params

    @abstractmethod
    def extract(self, config_dir: Path) -> ExtractResult:
        """Return the objectives and measures of the set with this folder."""

    @classmethod
    def names(cls, params: dict[str, Any]) -> frozenset[str] | None:
        """Names of all its numbers; None if they are not known before runs exist."""
        del params
        return None

    TABLES: bool = False
    """Whether the campaign's tables must be up to date before it is called."""


def run_dirs(config_dir: Path) -> list[Path]:
    """The folders of a set's runs, by number."""
    folder = Path(config_dir)
    return Layout(folder.parent).run_folders_of(folder.name)


def completed_run_dirs(config_dir: Path) -> list[Path]:
    """The folders of a set's runs that came to a verdict, by number.

    Errored runs are no evidence, even if they left a `test.xml`.
    """
    return [run for run in run_dirs(config_dir) if verdict_of(run) in _EVIDENCE]


def verdict_of(run: Path) -> Verdict:
    """The verdict of a stored run."""
    record = read_run_record(run)
    return record.verdict if record is not None else read_test_result(run).verdict

"""What strategies exchange with the search: parameter sets, evaluations, reports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from robovast.model.document.search.space import set_id


@dataclass
class ParamSet:
    """A proposed parameter set."""

    values: dict[str, Any]
    """Value of every dimension of the search space."""
    id: str = ""
    """Identifier of the values; derived from them."""
    n_reps: int | None = None
    """How often the set is run in all; None means `execution.runs`."""

    def __post_init__(self) -> None:
        self.id = self.id or set_id(self.values)


@dataclass
class Evaluation:
    """The result of a parameter set."""

    params: ParamSet
    objectives: dict[str, float]
    measures: dict[str, float] = field(default_factory=dict)
    n_samples: int = 0
    """Number of runs with a verdict."""
    raw: Mapping[str, Any] = field(default_factory=dict)
    """`config_dir`: the folder of the set's runs."""
    n_runs: int = 0
    """Number of runs, with a verdict or without; 0 if it is not known."""


@dataclass
class SearchReport:
    """What a strategy has found."""

    evaluations: list[Evaluation] = field(default_factory=list)
    """The best first."""
    best: Evaluation | None = None
    front: list[Evaluation] = field(default_factory=list)
    """Of several objectives, those that no other beats in all."""
    extra: dict[str, Any] = field(default_factory=dict)
    """Numbers and tables of the strategy; criteria of the kind `metric` compare the numbers."""

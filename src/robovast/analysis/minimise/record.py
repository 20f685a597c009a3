"""`minimise.json` in a campaign's folder: what is minimised, and each step on the way."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from robovast.analysis.minimise.shrinking import Items, Ladder, Parameters
from robovast.analysis.minimise.trials import Judged, TrialOutcome
from robovast.base.atomic import write_atomically
from robovast.base.errors import InputError
from robovast.base.safe_paths import read_file
from robovast.base.sequential import SequentialTest
from robovast.campaign.layout import Layout
from robovast.campaign.run_record import record_text

RECORD = "minimise.json"


@dataclass(frozen=True)
class MinimiseRequest:
    """What is minimised, and how."""

    run: str
    """`<campaign>/<variant>/<number>`."""
    seed: int | None
    """The run's."""
    cause: str
    """The run's reason; others of one cause differ only in numbers."""
    test: SequentialTest
    reductions: tuple[Items | Ladder, ...]

    def factors(self, parameters: Parameters) -> dict[str, Any]:
        """What is varied, for tables and the page."""
        return {r.parameter: {"value": shown(parameters[r.parameter])} for r in self.reductions}

    def fits(self, own: Parameters) -> bool:
        """Whether these are parameters that it can make milder."""
        return all(
            isinstance(own.get(r.parameter), list)
            if isinstance(r, Items)
            else r.values[-1] == own.get(r.parameter)
            for r in self.reductions
        )

    def changes(self, own: Parameters, now: Parameters) -> dict[str, Any]:
        """What is milder than in the run: numbers of items, and values."""
        names = [reduction.parameter for reduction in self.reductions]
        return {name: shown(now[name]) for name in names if now[name] != own[name]}


def shown(value: Any) -> Any:
    """A value as it is recorded; of a list the number of items."""
    return len(value) if isinstance(value, list) else value


@dataclass(frozen=True)
class MinimiseStep:
    """Parameters that were tried."""

    configuration: str
    """Name of their folder in the campaign."""
    changes: Mapping[str, Any]
    judged: Judged
    parameters: Parameters

    @property
    def is_kept(self) -> bool:
        """Whether they still fail."""
        return self.judged.outcome is TrialOutcome.FAILS

    @property
    def example(self) -> str:
        """`<configuration>/<number>` of a run that shows the outcome."""
        return f"{self.configuration}/{self.judged.example.run if self.judged.example else 0}"

    def __str__(self) -> str:
        changes = ", ".join(f"{name} {value}" for name, value in self.changes.items())
        failed = f"{self.judged.failed} of {self.judged.runs} failed so"
        return f"{changes or 'as it was'}: {self.judged.outcome} ({failed})"


def write_path(
    layout: Layout, request: MinimiseRequest, steps: Sequence[MinimiseStep], end: str | None = None
) -> None:
    """Write the way so far."""
    test, best = request.test, next((step for step in reversed(steps) if step.is_kept), None)
    data = {
        "run": request.run,
        "seed": request.seed,
        "cause": request.cause,
        "test": {"good": test.good, "bad": test.bad, "error": test.error, "most": test.most},
        "reductions": [
            {"parameter": r.parameter, "items": True}
            if isinstance(r, Items)
            else {"parameter": r.parameter, "values": list(r.values)}
            for r in request.reductions
        ],
        "steps": [
            {
                "configuration": step.configuration,
                "changes": dict(step.changes),
                "outcome": step.judged.outcome,
                "runs": step.judged.runs,
                "failed": step.judged.failed,
                "reason": step.judged.reason,
                "example": step.example,
            }
            for step in steps
        ],
        "end": end,
        "minimal": best
        and {
            "configuration": best.configuration,
            "example": best.example,
            "parameters": dict(best.parameters),
        },
    }
    write_atomically(layout.root / RECORD, record_text(data))


class _Items(BaseModel):
    parameter: str
    items: Literal[True]


class _Ladder(BaseModel):
    model_config = ConfigDict(strict=True)

    parameter: str
    values: Annotated[list[bool | int | float | str], Field(min_length=2)]


class _Test(BaseModel):
    good: Annotated[float, Field(gt=0, lt=1)]
    bad: Annotated[float, Field(gt=0, lt=1)]
    error: Annotated[float, Field(gt=0, lt=0.5)]
    most: Annotated[int, Field(ge=1)]


class _Recorded(BaseModel):
    run: str
    seed: int | None
    cause: str
    test: _Test
    reductions: list[_Items | _Ladder]


def read_request(layout: Layout) -> MinimiseRequest:
    """What a campaign minimises.

    Raises:
        InputError: nothing, or its record is damaged.
    """
    path = layout.root / RECORD
    try:
        found = _Recorded.model_validate(json.loads(read_file(path, layout.root)))
    except (OSError, ValueError, RecursionError) as error:
        why = (
            "is damaged" if not isinstance(error, OSError) else f"cannot be read: {error.strerror}"
        )
        raise InputError(
            f"{path}: {why}", hint="use `--resume` with a folder that `vast minimise` created"
        ) from None
    reductions: list[Items | Ladder] = [
        Items(r.parameter) if isinstance(r, _Items) else Ladder(r.parameter, tuple(r.values))
        for r in found.reductions
    ]
    test = SequentialTest(**found.test.model_dump())
    return MinimiseRequest(found.run, found.seed, found.cause, test, tuple(reductions))

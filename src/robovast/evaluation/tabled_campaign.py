"""A campaign whose runs are read from its tables, where its folder is not here."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import Any

from robovast.analysis.tables.query import ask
from robovast.analysis.tables.runs import FACTOR, PARAMETER
from robovast.analysis.tables.stored import StoredTables
from robovast.campaign.verdict import Verdict
from robovast.evaluation.campaign_index import by_number
from robovast.evaluation.stored_runs import LONGEST_REASON
from robovast.evaluation.summaries import RunSummary, VariantRuns

_OWN = "config|entry|run|verdict|reason|started_at|duration|seed|reused_from"
_RUNS = (
    f"SELECT COLUMNS('^({_OWN})$|^({PARAMETER}|{FACTOR})') FROM runs "  # noqa: S608
    "ORDER BY config, run"
)


def read_variants(tables: Path | StoredTables) -> list[VariantRuns]:
    """The variants that have stored runs; units of factors are not in tables.

    Raises:
        CannotRunError: the extra `query` is not installed.
        StorageError: the tables cannot be read.
    """
    answer = ask([tables], _RUNS)
    rows = (dict(zip(answer.columns, row, strict=True)) for row in answer.rows)
    grouped = groupby(rows, key=lambda row: str(row["config"]))
    found = [_variant(name, list(group)) for name, group in grouped]
    return sorted(found, key=lambda variant: by_number(variant.name))


def _variant(name: str, rows: list[dict[str, Any]]) -> VariantRuns:
    first = rows[0]
    parameters, factors = (_values(first, prefix) for prefix in (PARAMETER, FACTOR))
    return VariantRuns(
        name, str(first["entry"] or name), parameters, tuple(map(_run, rows)), factors
    )


def _run(row: Mapping[str, Any]) -> RunSummary:
    return RunSummary(
        number=row["run"],
        verdict=Verdict(row["verdict"]),
        reason=(row["reason"] or "")[:LONGEST_REASON],
        started_at=_seconds(row["started_at"]),
        duration=row["duration"],
        seed=row["seed"],
        reused=bool(row["reused_from"]),
    )


def _seconds(moment: datetime | None) -> float | None:
    return None if moment is None else moment.replace(tzinfo=UTC).timestamp()


def _values(row: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Values in the columns with a prefix; lists and mappings are JSON there."""
    return {
        name.removeprefix(prefix): _plain(value)
        for name, value in row.items()
        if name.startswith(prefix) and value is not None
    }


def _plain(value: Any) -> Any:
    if isinstance(value, str) and value[:1] in {"[", "{"}:
        try:
            return json.loads(value)
        except ValueError:
            return value
    return value

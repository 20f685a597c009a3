"""`metrics`: numbers from columns of the runs' tables, or from SQL, without code."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from robovast.analysis.tables.csv_files import csv_files, read_header, read_rows
from robovast.analysis.tables.query import ask
from robovast.campaign.layout import COLUMNAR_TABLES
from robovast.model.document.search.section import SearchMetric
from robovast.search.extractor import Extractor, ExtractResult, completed_run_dirs
from robovast.search.extractors.failure_rate import NAME, failure_rate

_AGGREGATES: dict[str, Callable[[Sequence[float]], float]] = {
    "min": min,
    "max": max,
    "mean": statistics.fmean,
    "median": statistics.median,
    "sum": sum,
    "first": lambda values: values[0],
    "last": lambda values: values[-1],
}


class ColumnExtractor(Extractor):
    """Aggregates columns over time and runs; `failure_rate` is always among its numbers.

    Args:
        metrics: the document's `extract.metrics`.
    """

    def __init__(self, **metrics: Any) -> None:
        super().__init__(**metrics)
        self._metrics = {name: SearchMetric.model_validate(m) for name, m in metrics.items()}
        self._answers: dict[tuple[str, int], dict[str, Any]] = {}
        self.TABLES = any(metric.sql is not None for metric in self._metrics.values())

    def extract(self, config_dir: Path) -> ExtractResult:
        """Return all numbers, each as objective and as measure.

        Raises:
            ValueError: a run has no such table, column or number, or a query no such row.
        """
        found = {NAME: failure_rate(config_dir)}
        for name, metric in self._metrics.items():
            is_query = metric.sql is not None
            found[name] = (
                self._query(metric.sql or "", config_dir) if is_query else _over(metric, config_dir)
            )
        return ExtractResult(dict(found), dict(found))

    @classmethod
    def names(cls, params: dict[str, Any]) -> frozenset[str]:
        """All numbers."""
        return frozenset({NAME, *params})

    def _query(self, sql: str, config_dir: Path) -> float:
        """The number of a set in the answer of a query, which is asked once for the same tables."""
        campaign = config_dir.parent
        key = (sql, (campaign / COLUMNAR_TABLES).stat().st_mtime_ns)
        if key not in self._answers:
            answer = ask([campaign], sql)
            if len(answer.columns) != 2:
                raise ValueError(f"the query must give `config` and a number, not {answer.columns}")
            self._answers = {key: {str(config): value for config, value in answer.rows}}
        value = self._answers[key].get(config_dir.name)
        if value is None:
            raise ValueError(f"the query gives no row for `{config_dir.name}`: {sql}")
        return float(value)


def _over(metric: SearchMetric, config_dir: Path) -> float:
    over_time = _AGGREGATES[metric.over_time or "last"]
    over_runs = _AGGREGATES[metric.over_runs]
    runs = completed_run_dirs(config_dir)
    return over_runs([over_time(_numbers(metric, run)) for run in runs])


def _numbers(metric: SearchMetric, run: Path) -> list[float]:
    """The finite numbers of a column."""
    table, column = metric.table or "", metric.column or ""
    path = csv_files(run).get(table)
    if path is None:
        raise ValueError(f"{run.parent.name}/{run.name} has no table `{table}`")
    header = read_header(path)
    if column not in header:
        known = ", ".join(header) or "none"
        raise ValueError(f"the table `{table}` has no column `{column}`; it has {known}")
    place = header.index(column)
    found = list(_finite(row[place] for row in read_rows(path, len(header))))
    if not found:
        raise ValueError(f"{run.parent.name}/{run.name}: no number in `{table}.{column}`")
    return found


def _finite(cells: Iterator[str]) -> Iterator[float]:
    for cell in cells:
        try:
            value = float(cell or "nan")
        except ValueError:
            continue
        if math.isfinite(value):
            yield value

"""One row per run: identity, parameters, verdict and times."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from robovast.analysis.provenance.times import as_utc, from_epoch, later
from robovast.base.errors import InputError
from robovast.base.yaml_files import read_mapping_leniently
from robovast.campaign.configurations import read_configurations
from robovast.campaign.layout import SCENARIO_CONFIG, Layout
from robovast.campaign.run_record import (
    COLUMNS,
    RunRecord,
    read_run_record,
    result_without_record,
)
from robovast.model.variations.factors import FACTORS, factor_values

_MOST_VALUES = 1_000
"""Most parameters of a run that are columns; more are one column in JSON."""
PARAMETER = "param_"
"""Prefix of columns with scenario parameters."""
FACTOR = "factor_"
"""Prefix of columns with what was varied, in campaigns whose variation types state it."""

Row = dict[str, Any]


def run_rows(layout: Layout, runs: Iterable[str]) -> Iterator[Row]:
    """One row per run, given as `<variant>/<number>`; unknown values are None.

    Runs of other tools have no `run.json`; their test.xml and the campaign's list of configurations
    are used.
    """
    configurations = _configurations(layout)
    states = any(FACTORS in item for item in configurations.values())
    for run in runs:
        variant, _, number = run.rpartition("/")
        configuration = configurations.get(variant, {})
        row, parameters = _row(layout.run(run), variant, int(number), configuration)
        factors = factor_values(configuration.get(FACTORS)) or parameters
        yield {**row, **(_columns(FACTOR, factors) if states else {})}


def record_rows(records: Sequence[RunRecord]) -> Iterator[Row]:
    """The rows of runs with these records, as `run_rows` makes them."""
    states = any(record.factors for record in records)
    for record in records:
        row, parameters = _recorded(record, record.variant, record.run, record.parameters)
        factors = factor_values(record.factors) or parameters
        yield {**row, **(_columns(FACTOR, factors) if states else {})}


def _configurations(layout: Layout) -> dict[str, dict[str, Any]]:
    try:
        items = read_configurations(layout)["configs"]
    except InputError:
        return {}
    return {str(item.get("name")): item for item in items if isinstance(item, dict)}


def _row(
    folder: Path, variant: str, number: int, configuration: Mapping[str, Any]
) -> tuple[Row, Mapping[str, Any]]:
    """A run's values, including its parameters, and the parameters alone."""
    record = read_run_record(folder)
    if record is not None:
        given = record.parameters or configuration.get("config") or {}
        return _recorded(record, variant, number, given)
    row: Row = {**dict.fromkeys(COLUMNS), "config": variant, "run": number}
    row.update(_judged(folder), entry=configuration.get("_config_name"))
    return _with_parameters(row, configuration.get("config") or _scenario_config(folder.parent))


def _recorded(
    record: RunRecord, variant: str, number: int, parameters: object
) -> tuple[Row, Mapping[str, Any]]:
    """A run's values of its record, including its parameters, and the parameters alone."""
    known = {name: getattr(record, name) for name in COLUMNS if hasattr(record, name)}
    row = {**dict.fromkeys(COLUMNS), **known, "config": variant, "run": number}
    row.update(verdict=str(record.verdict))
    row.update(started_at=plain_time(record.started_at), finished_at=plain_time(record.finished_at))
    return _with_parameters(row, parameters)


def _with_parameters(row: Row, parameters: object) -> tuple[Row, Mapping[str, Any]]:
    if not isinstance(parameters, Mapping):
        return row, {}
    return {**row, **_columns(PARAMETER, parameters)}, parameters


def _columns(prefix: str, values: Mapping[str, Any]) -> Row:
    if len(values) > _MOST_VALUES:
        return {f"{prefix}json": json.dumps(values, default=str, ensure_ascii=False)}
    return {prefix + str(name): _cell(value) for name, value in values.items()}


def _judged(folder: Path) -> Row:
    """A run's values without a record."""
    result = result_without_record(folder)
    start = from_epoch(result.started_at)
    end = later(start, result.duration)
    return {
        "verdict": str(result.verdict),
        "reason": result.reason,
        "started_at": plain_time(start),
        "finished_at": plain_time(end),
        "duration": result.duration,
    }


def _scenario_config(variant: Path) -> Mapping[str, Any]:
    """Parameters in `_config/scenario.config`, below the name of the scenario."""
    data = read_mapping_leniently(variant / SCENARIO_CONFIG)
    inner = next(iter(data.values()), None)
    return inner if isinstance(inner, dict) else {}


def plain_time(time: str | datetime | None) -> str | None:
    """A time in UTC without time zone, as tables have it; None if it is none."""
    utc = as_utc(time)
    return utc and datetime.fromisoformat(utc).replace(tzinfo=None).isoformat(" ")


def _cell(value: Any) -> Any:
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return json.dumps(value, default=str, ensure_ascii=False)

"""A campaign whose runs are read from its tables, where its folder is not here."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

from robovast.analysis.tables.query import ask
from robovast.analysis.tables.runs import FACTOR, PARAMETER
from robovast.analysis.tables.stored import StoredTables
from robovast.base.errors import InputError, StorageError
from robovast.campaign.verdict import Verdict
from robovast.evaluation.campaign_index import by_number
from robovast.evaluation.summaries import LISTED, RunSummary, VariantRuns
from robovast.evaluation.untrusted_data import parse_json, plain

_OWN = "|".join(["config", "entry", *LISTED])
_RUNS = (
    f"SELECT COLUMNS('^({_OWN})$|^({PARAMETER}|{FACTOR})') "  # noqa: S608
    "FROM (SELECT * REPLACE (epoch(started_at) AS started_at) FROM runs) ORDER BY config, run"
)
_VERDICTS = {str(verdict): verdict for verdict in Verdict}


def read_variants(tables: Path | StoredTables) -> list[VariantRuns]:
    """The variants that have stored runs; units of factors are not in tables.

    Raises:
        CannotRunError: the extra `query` is not installed.
        StorageError: the tables cannot be read.
    """
    try:
        answer = ask([tables], _RUNS)
    except InputError as error:
        raise StorageError(f"the tables are not tables of a campaign: {error.message}") from None
    run_of = _reader(answer.columns)
    grouped = groupby(answer.rows, key=itemgetter(answer.columns.index("config")))
    found = []
    for name, group in grouped:
        rows = list(group)
        first = dict(zip(answer.columns, rows[0], strict=True))
        found.append(_variant(str(name), first, tuple(map(run_of, rows))))
    return sorted(found, key=lambda variant: by_number(variant.name))


def _variant(name: str, first: Mapping[str, Any], runs: tuple[RunSummary, ...]) -> VariantRuns:
    parameters, factors = (_values(first, prefix) for prefix in (PARAMETER, FACTOR))
    return VariantRuns(name, str(first["entry"] or name), parameters, runs, factors)


def _reader(columns: Sequence[str]) -> Callable[[tuple[Any, ...]], RunSummary]:
    """What makes the run of a row; there may be many. Tables of RoboVAST 1.x lack some columns,
    and an unknown verdict counts as errored."""
    places = [columns.index(name) if name in columns else -1 for name in LISTED]
    values = itemgetter(*places)

    def read(row: tuple[Any, ...]) -> RunSummary:
        number, verdict, *others = values((*row, None))
        return RunSummary.of(number, _VERDICTS.get(str(verdict), Verdict.ERRORED), *others)

    return read


def _values(row: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Values in the columns with a prefix; lists and mappings are JSON there."""
    return {
        name.removeprefix(prefix): _plain(value)
        for name, value in row.items()
        if name.startswith(prefix) and value is not None
    }


def _plain(value: Any) -> Any:
    if isinstance(value, str) and value[:1] in {"[", "{"}:
        parsed = parse_json(value.encode())
        return value if parsed is None else parsed
    with suppress(ValueError):  # it is too large for the page
        return plain(value)
    return None

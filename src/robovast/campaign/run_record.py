"""`run.json`, the record of a run, which is written last and atomically.

A run's folder is complete if it has a `run.json`; otherwise it must not be trusted.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, get_type_hints

from pydantic import TypeAdapter
from pydantic_core import from_json

from robovast.base.safe_paths import read_file, status
from robovast.campaign.layout import RUN_RECORD, TEST_RESULT
from robovast.campaign.run_files import FileList, MissingFile, with_unknown, with_unknown_apart
from robovast.campaign.verdict import TestResult, Verdict, read_test_result

SCHEMA = 1
"""Version of the format; added keys do not change it, since readers ignore unknown ones."""

PLACE = "files"
"""Key that refers to the run's files in a bucket; not a property of the run itself."""


_TEXTS = frozenset({"campaign", "variant", "entry", "reason", "parameters", "factors", "image"})
"""Keys of texts that are written into other files."""
_LEFT_OUT_EMPTY = (PLACE, "missing", "pod", "factors", "key", "reused_from")


@dataclass(frozen=True)
class Column:
    """Makes a property of a run a column of the table `runs`."""

    sql_type: str
    in_index: bool = False
    """Whether `index.json` has it, too."""


_TEXT, _NUMBER = Column("VARCHAR"), Column("BIGINT")
_TIME = Column("TIMESTAMP", in_index=True)


@dataclass(frozen=True)
class RunRecord:
    """Identity, parameters, verdict and circumstances of one run.

    The only list of a run's properties: the table `runs` and `index.json` follow from it.
    """

    campaign: str
    variant: str
    entry: Annotated[str, _TEXT]
    run: Annotated[int, Column("INTEGER")]
    id: Annotated[int, _NUMBER]
    verdict: Annotated[Verdict, Column("VARCHAR", in_index=True)]
    reason: Annotated[str, Column("VARCHAR", in_index=True)]
    """Why the run did not pass; empty if it did."""
    started_at: Annotated[str, _TIME]
    """ISO 8601, UTC."""
    finished_at: Annotated[str, _TIME]
    duration: Annotated[float, Column("DOUBLE", in_index=True)]
    """[s]"""
    exit_code: Annotated[int | None, _NUMBER]
    """Exit code of the process that executed the scenario; None if it did not end by itself."""
    attempt: Annotated[int, Column("BIGINT", in_index=True)]
    job: Annotated[str, Column("VARCHAR", in_index=True)]
    runtime: Annotated[str, _TEXT]
    image: Annotated[str, _TEXT]
    image_digest: str
    host: Annotated[str, _TEXT]
    pod: str = ""
    """The pod that executed the run on a cluster, else empty."""
    seed: Annotated[int | None, _NUMBER] = None
    """Seed of the run's random numbers; None in campaigns of RoboVAST 1.x."""
    key: str = ""
    """What the run depended on, as a hash: equal keys mean the same work; empty if not known."""
    outputs: dict[str, str] | None = None
    """SHA-256 of each file that the run wrote, by path; None if not known."""
    reused_from: Annotated[str, _TEXT] = ""
    """`<campaign>/<variant>/<run>` that was executed, if this record is of a copy of it."""
    parameters: dict[str, Any] = field(default_factory=dict)
    factors: dict[str, Any] = field(default_factory=dict)
    """What was varied, as `{name: {value, unit}}`; empty if it is just the parameters."""
    files: FileList | None = None
    """In a bucket: reference to the list of files; None if the files are beside the record."""
    missing: tuple[MissingFile, ...] = ()
    """Files that the run wrote and that could not be stored."""
    schema: int = SCHEMA
    unknown: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)
    """Keys that a newer version wrote; kept when the record is rewritten."""

    @property
    def finished(self) -> bool:
        """Whether the run need not be executed again."""
        return self.verdict is not Verdict.INTERRUPTED

    def write(self, folder: Path) -> None:
        """Write `run.json` into a run's folder that is not in its final place yet."""
        _write(folder, self._data())

    def to_json(self) -> str:
        """The content of `run.json`."""
        return record_text(self._data())

    def _data(self) -> dict[str, Any]:
        data = with_unknown(asdict(self))
        data["missing"] = [file.data() for file in self.missing]
        if data[PLACE]:
            data[PLACE] = with_unknown(data[PLACE])
        left_out = {key for key in _LEFT_OUT_EMPTY if not data[key]}
        left_out |= {key for key in ("seed", "outputs") if data[key] is None}
        return {key: value for key, value in data.items() if key not in left_out}


_COLUMNS = {
    name: column
    for name, hint in get_type_hints(RunRecord, include_extras=True).items()
    for column in getattr(hint, "__metadata__", ())
}
COLUMNS = {"config": "VARCHAR", "run": "INTEGER"} | {
    name: column.sql_type for name, column in _COLUMNS.items()
}
"""Columns of the table `runs` with their SQL types; `config` is the variant, times are UTC."""
IN_INDEX = tuple(name for name, column in _COLUMNS.items() if column.in_index)
"""Properties of a run in `index.json`, beside its identity."""


def copy_run_record(source: Path, target: Path, **changes: Any) -> None:
    """Copy a run's `run.json` into another folder that is not in its final place yet.

    Args:
        source: folder with a record.
        target: folder without a record.
        changes: new values of keys; other keys are kept, including those of newer versions.
    """
    data = json.loads(read_file(source / RUN_RECORD))
    _write(target, {**data, **changes})


def _write(folder: Path, data: dict[str, Any]) -> None:
    path = folder / RUN_RECORD
    path.unlink(missing_ok=True)
    with path.open("x", encoding="utf-8") as file:
        file.write(record_text(data))


def record_text(data: Mapping[str, Any]) -> str:
    """A record's data as JSON text."""
    return json.dumps(data, indent=1, default=str) + "\n"


def read_run_record(folder: Path) -> RunRecord | None:
    """The record in a run's folder; None if it is missing or has another format."""
    try:
        return parse_run_record(read_file(folder / RUN_RECORD, folder.parent))
    except OSError:
        return None


def parse_run_record(text: str | bytes) -> RunRecord | None:
    """The record in the text of a `run.json`; None if it has another format."""
    try:
        data = with_unknown_apart(_parse(text), RunRecord)
        if data.get(PLACE):
            data[PLACE] = with_unknown_apart(data[PLACE], FileList)
        record = _adapter().validate_python(data)
    except (ValueError, TypeError, AttributeError, RecursionError):
        return None
    return record if record.schema <= SCHEMA else None


def parse_known(text: str | bytes) -> RunRecord | None:
    """As `parse_run_record`, without the keys of newer versions: to list very many records."""
    try:
        record = _adapter().validate_json(text)
    except ValueError:
        return parse_run_record(text)
    if not isfinite(record.duration):  # may be a whole number that no float can hold
        return parse_run_record(text)
    return record if record.schema <= SCHEMA else None


def _parse(text: str | bytes) -> Any:
    """JSON data, by the faster parser where it can: it knows no lone surrogates.

    Names of files keep those, since they stand for bytes; no file could hold them in other texts.
    """
    try:
        return from_json(text)
    except ValueError:
        data = json.loads(text)
        for key in _TEXTS & data.keys():
            data[key] = from_json(
                json.dumps(data[key], ensure_ascii=False).encode(errors="replace")
            )
        return data


def result_without_record(folder: Path) -> TestResult:
    """The result of a run without a readable record, from its test.xml.

    If a newer version wrote the record, the run counts as errored, whatever test.xml says. If there
    is one that cannot be read, the reason says so, even of a run that passed.
    """
    with suppress(OSError, ValueError, TypeError, KeyError, RecursionError):
        if json.loads(read_file(folder / RUN_RECORD, folder.parent))["schema"] > SCHEMA:
            return TestResult(
                Verdict.ERRORED, f"{RUN_RECORD} was written by a newer version of RoboVAST"
            )
    result = read_test_result(folder)
    if status(folder / RUN_RECORD, folder.parent) is None:
        return result
    decides = "" if result.verdict is Verdict.ERRORED else f", so {TEST_RESULT} decides"
    note = f"{RUN_RECORD} cannot be read{decides}"
    return replace(result, reason="; ".join(filter(None, (result.reason, note))))


@cache
def _adapter() -> TypeAdapter[RunRecord]:
    return TypeAdapter(RunRecord)

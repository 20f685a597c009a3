"""`run.json`: what is known of one run, written last and atomically.

A run folder with a `run.json` is complete; one without is not to be trusted.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from robovast.base.safe_paths import read_file
from robovast.campaign.layout import RUN_RECORD
from robovast.campaign.run_files import FileList, MissingFile, with_unknown, with_unknown_apart
from robovast.campaign.verdict import TestResult, Verdict, read_test_result

SCHEMA = 1
"""Version of the record's format; it stays when keys are added, which older versions ignore."""

PLACE = "files"
"""Key that says where in a bucket the run's files are; no property of the run itself."""


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
    pod: str = ""
    """On a cluster: the pod that executed it; empty where there is none."""
    parameters: dict[str, Any] = field(default_factory=dict)
    files: FileList | None = None
    """In a bucket: where its files are listed; None where they are beside it."""
    missing: tuple[MissingFile, ...] = ()
    """What the run wrote and could not be stored."""
    schema: int = SCHEMA
    unknown: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)
    """What a newer version has written besides; it stays when the record is written again."""

    @property
    def finished(self) -> bool:
        """True when the run need not be executed again."""
        return self.verdict is not Verdict.INTERRUPTED

    def write(self, folder: Path) -> None:
        """Write `run.json` into the folder of a run that is not in its place yet."""
        _write(folder, self._data())

    def to_json(self) -> str:
        """The text of `run.json`."""
        return record_text(self._data())

    def _data(self) -> dict[str, Any]:
        data = with_unknown(asdict(self))
        data["missing"] = [file.data() for file in self.missing]
        if data[PLACE]:
            data[PLACE] = with_unknown(data[PLACE])
        left_out = {key for key in (PLACE, "missing", "pod") if not data[key]}
        return {key: value for key, value in data.items() if key not in left_out}


def copy_run_record(source: Path, target: Path, **changes: Any) -> None:
    """Copy `run.json` of one run's folder to another's, which is not in its place yet.

    Args:
        source: folder of a run with a record.
        target: folder of a run without.
        changes: other values of keys; all other keys stay, those of newer versions too.
    """
    data = json.loads((source / RUN_RECORD).read_bytes())
    _write(target, {**data, **changes})


def _write(folder: Path, data: dict[str, Any]) -> None:
    path = folder / RUN_RECORD
    path.unlink(missing_ok=True)
    with path.open("x", encoding="utf-8") as file:
        file.write(record_text(data))


def record_text(data: Mapping[str, Any]) -> str:
    """Content of a record as it is written."""
    return json.dumps(data, indent=1, default=str) + "\n"


def read_run_record(folder: Path) -> RunRecord | None:
    """The record in a run's folder; None when there is none, or none of this format."""
    try:
        return parse_run_record(read_file(folder / RUN_RECORD, folder.parent))
    except OSError:
        return None


def parse_run_record(text: str | bytes) -> RunRecord | None:
    """The record in the text of a `run.json`; None when it is none of this format."""
    try:
        data = with_unknown_apart(json.loads(text), RunRecord)
        if data.get(PLACE):
            data[PLACE] = with_unknown_apart(data[PLACE], FileList)
        record = _adapter().validate_python(data)
    except (ValueError, TypeError, AttributeError, RecursionError):
        return None
    return record if record.schema <= SCHEMA else None


def result_without_record(folder: Path) -> TestResult:
    """What is known of a run that has no record of this format: its test.xml says it.

    Not so where a newer version has written the record: it may say otherwise.
    """
    with suppress(OSError, ValueError, TypeError, KeyError, RecursionError):
        if json.loads(read_file(folder / RUN_RECORD, folder.parent))["schema"] > SCHEMA:
            return TestResult(
                Verdict.ERRORED, f"{RUN_RECORD} is of a newer version of RoboVAST than this"
            )
    return read_test_result(folder)


@cache
def _adapter() -> TypeAdapter[RunRecord]:
    return TypeAdapter(RunRecord)

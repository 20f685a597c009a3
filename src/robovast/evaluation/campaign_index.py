"""All runs of one campaign, kept up to date while it is executed.

Reading 10,000 records takes about a second, so a variant is read again only when its folder has
changed: a run enters it at once and complete, by a rename.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import stat
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from threading import Lock
from typing import Any

from robovast.errors import InputError
from robovast.evaluation.inside import read_small, resolved
from robovast.evaluation.untrusted import mapping, parse_yaml, plain
from robovast.results.layout import RUN_RECORD, TEST_RESULT
from robovast.results.verdict import Verdict, read_test_result

SETTLED = 2.0
"""A folder that changed less than this ago may change again unseen, within its time stamp [s]."""
LARGEST_RECORD = 1 << 20
"""[bytes]"""
LONGEST_REASON = 500
"""Characters of a reason in lists; the page of the run has all of it."""


@dataclass(frozen=True, slots=True)
class RunSummary:
    """What lists of runs show of one run."""

    number: int
    verdict: Verdict
    reason: str
    started_at: float | None
    """[s since the epoch]"""
    duration: float | None
    """[s]"""
    job: str


@dataclass(frozen=True, slots=True)
class VariantRuns:
    """A variant and its stored runs, by number."""

    name: str
    entry: str
    parameters: Mapping[str, Any]
    runs: tuple[RunSummary, ...]


@dataclass(frozen=True, slots=True)
class ActiveJob:
    """A job that is being executed."""

    name: str
    log: str | None
    """Path of its log relative to the results folder; None before it has one."""


@dataclass(frozen=True)
class CampaignSummary:
    """What a list of campaigns shows of one campaign."""

    name: str
    state: str
    """`running`, `finished`, or `incomplete`: nothing executes it, and runs are missing."""
    planned: int
    """Runs that it is to have."""
    counts: Mapping[Verdict, int]
    """Stored runs by verdict."""
    variants: int
    started_at: float | None
    """[s since the epoch]"""
    duration: float | None
    """From its start to the end of its last run, or until now while it is running [s]."""
    execution: Mapping[str, Any]
    """Content of execution.yaml."""
    version: int
    """Grows with every change."""


@dataclass
class _Known:
    changed: int
    settled: bool
    variant: VariantRuns


@dataclass
class CampaignIndex:
    """The runs of a campaign's folder; threads may share it."""

    results: Path
    """The results folder, without links."""
    name: str
    """The campaign's folder in it."""
    version: int = 0
    _known: dict[str, _Known] = field(default_factory=dict)
    _state: tuple[Any, ...] = ()
    _lock: Lock = field(default_factory=Lock)

    @property
    def root(self) -> Path:
        """The campaign's folder."""
        return self.results / self.name

    def refresh(self) -> bool:
        """Read what has changed; True when anything has.

        Raises:
            InputError: the folder is gone.
        """
        with self._lock:
            resolved(self.results, self.name)
            changed = self._refresh_variants()
            state = (
                self._active_jobs() if is_running(self.root) else None,
                _mtime(self.root / "_execution" / "execution.yaml"),
            )
            changed |= state != self._state
            self._state = state
            self.version += changed
            return changed

    @property
    def running(self) -> bool:
        """Whether it was being executed when it was last read."""
        return bool(self._state) and self._state[0] is not None

    @property
    def active(self) -> list[ActiveJob]:
        """Jobs that were being executed when it was last read, in order."""
        return list(self._state[0]) if self.running else []

    @property
    def variants(self) -> list[VariantRuns]:
        """All variants, those without runs included; `two-2-10` comes after `two-2-9`."""
        return [known.variant for _, known in sorted(self._known.items(), key=_by_name)]

    def summary(self) -> CampaignSummary:
        """Counts and times of what was last read."""
        variants = self.variants
        runs = [run for variant in variants for run in variant.runs]
        execution = read_execution(self.results, self.name)
        planned = max(len(variants) * _whole(execution.get("runs")), len(runs))
        counts = dict.fromkeys(Verdict, 0)
        for run in runs:
            counts[run.verdict] += 1
        missing = planned - len(runs) + counts[Verdict.INTERRUPTED]
        state = "running" if self.running else "incomplete" if missing else "finished"
        started = _seconds(execution.get("execution_time"))
        starts = [run.started_at for run in runs if run.started_at is not None]
        started = min(starts, default=None) if started is None else started
        ends = [run.started_at + (run.duration or 0) for run in runs if run.started_at is not None]
        end = time.time() if self.running else max(ends, default=None)
        return CampaignSummary(
            name=self.name,
            state=state,
            planned=planned,
            counts=counts,
            variants=len(variants),
            started_at=started,
            duration=None if started is None or end is None else max(0.0, end - started),
            execution=execution,
            version=self.version,
        )

    def _active_jobs(self) -> tuple[ActiveJob, ...]:
        try:
            names = [e.name for e in os.scandir(self.root / ".running") if _JOB.fullmatch(e.name)]
        except OSError:  # it has just ended
            return ()
        return tuple(
            ActiveJob(name, self._log(name)) for name in sorted(names, key=lambda n: int(n[4:]))
        )

    def _log(self, job: str) -> str | None:
        """The job's own log, else what its process prints."""
        candidates = (f"_jobs/{job}/logs/system.log", f".running/{job}/console.log")
        found = (path for path in candidates if (self.root / path).is_file())
        return next((f"{self.name}/{path}" for path in found), None)

    def _refresh_variants(self) -> bool:
        changed = False
        now = time.time()
        with _folder(self.root) as campaign:
            found = {entry.name: entry for entry in os.scandir(campaign) if _is_variant(entry)}
            for name in self._known.keys() - found.keys():
                del self._known[name]
                changed = True
            for name, entry in found.items():
                mtime = entry.stat(follow_symlinks=False).st_mtime_ns
                known = self._known.get(name)
                if known is not None and known.changed == mtime and known.settled:
                    continue
                variant = self._read_variant(campaign, name, known)
                changed |= known is None or known.variant != variant
                settled = now - mtime / 1e9 > SETTLED
                self._known[name] = _Known(mtime, settled, variant)
        return changed

    def _read_variant(self, campaign: int, name: str, known: _Known | None) -> VariantRuns:
        with _folder(name, campaign) as variant:
            entries = [entry for entry in os.scandir(variant) if _is_run(entry)]
            records = [
                (int(entry.name), _read_record(variant, entry.name))
                for entry in sorted(entries, key=lambda entry: int(entry.name))
            ]
        first: Mapping[str, Any] = next((record for _, record in records if record), {})
        if isinstance(first.get("parameters"), dict):
            parameters = _bounded(first["parameters"])
        else:
            parameters = known.variant.parameters if known else self._scenario_parameters(name)
        runs = [
            _from_record(number, record) if record else self._from_test_result(name, number)
            for number, record in records
        ]
        entry = str(first.get("entry") or (known.variant.entry if known else name))
        return VariantRuns(name, entry, parameters, tuple(runs))

    def _from_test_result(self, variant: str, number: int) -> RunSummary:
        """A run without a record: of another program, or of an older version."""
        folder = self.root / variant / str(number)
        if not _is_small_file(folder / TEST_RESULT):
            return RunSummary(number, Verdict.ERRORED, f"there is no {TEST_RESULT}", None, None, "")
        result = read_test_result(folder)
        return RunSummary(
            number, result.verdict, result.reason, result.started_at, result.duration, ""
        )

    def _scenario_parameters(self, variant: str) -> dict[str, Any]:
        scenarios = read_yaml(self.results, f"{self.name}/{variant}/_config/scenario.config")
        return dict(next(map(mapping, scenarios.values()), {}))


def is_campaign(path: Path) -> bool:
    """Whether a folder holds a campaign."""
    return any((path / name).is_dir() for name in ("_execution", "_transient", "_config"))


def find_campaigns(results: Path) -> list[str]:
    """Names of the campaigns in a results folder, the newest first.

    Raises:
        InputError: the folder cannot be read.
    """
    try:
        folders = [e for e in os.scandir(results) if e.is_dir(follow_symlinks=False)]
    except OSError as error:
        raise InputError(f"{results}: cannot be read: {error.strerror}.") from None
    found = [entry for entry in folders if entry.name[0] not in "._" and is_campaign(Path(entry))]
    return [entry.name for entry in sorted(found, key=lambda e: (e.name[-17:], e.name))][::-1]


def is_running(campaign: Path) -> bool:
    """Whether a program executes it: the program holds a lock."""
    try:
        lock = os.open(campaign / ".running" / "lock", os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(lock)
    return False


def read_execution(results: Path, campaign: str) -> Mapping[str, Any]:
    """Content of a campaign's execution.yaml; empty when there is none that can be read."""
    return read_yaml(results, f"{campaign}/_execution/execution.yaml")


def read_yaml(root: Path, relative: str) -> Mapping[str, Any]:
    """A small file below a folder that holds a mapping; empty when there is none."""
    try:
        return mapping(parse_yaml(read_small(root, relative)))
    except InputError:
        return {}


@contextmanager
def _folder(path: Path | str, parent: int | None = None) -> Iterator[int]:
    flags = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
    descriptor = os.open(path, flags, dir_fd=parent)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _is_variant(entry: os.DirEntry[str]) -> bool:
    return entry.name[0] not in "._" and entry.is_dir(follow_symlinks=False)


_VERDICTS = list(Verdict)
_JOB = re.compile(r"job-[0-9]{1,9}")
_RUN = re.compile(r"0|[1-9][0-9]{0,8}")


def _is_run(entry: os.DirEntry[str]) -> bool:
    return bool(_RUN.fullmatch(entry.name)) and entry.is_dir(follow_symlinks=False)


def _is_small_file(path: Path) -> bool:
    try:
        status = path.lstat()
    except OSError:
        return False
    return stat.S_ISREG(status.st_mode) and status.st_size < LARGEST_RECORD


def _read_record(variant: int, run: str) -> Mapping[str, Any]:
    """A run's record; empty when there is none that can be read."""
    flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    try:
        descriptor = os.open(f"{run}/{RUN_RECORD}", flags, dir_fd=variant)
    except OSError:
        return {}
    try:
        record = mapping(json.loads(os.read(descriptor, LARGEST_RECORD)))
    except (OSError, ValueError, RecursionError):
        return {}
    finally:
        os.close(descriptor)
    return record if record.get("verdict") in _VERDICTS else {}


def _from_record(number: int, record: Mapping[str, Any]) -> RunSummary:
    return RunSummary(
        number=number,
        verdict=Verdict(record["verdict"]),
        reason=sys.intern(str(record.get("reason") or "")[:LONGEST_REASON]),
        started_at=_seconds(record.get("started_at")),
        duration=_number(record.get("duration")),
        job=sys.intern(str(record.get("job") or "")[:LONGEST_REASON]),
    )


def _bounded(parameters: Mapping[str, Any]) -> Mapping[str, Any]:
    try:
        return mapping(plain(parameters))
    except ValueError:
        return {}


def _seconds(value: Any) -> float | None:
    """A time of ISO 8601 as seconds since the epoch."""
    try:
        return datetime.fromisoformat(str(value)).timestamp()
    except (ValueError, OverflowError):
        return None


def _number(value: Any) -> float | None:
    usable = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if usable and abs(value) < float("inf") else None


def _whole(value: Any) -> int:
    return value if isinstance(value, int) and 0 < value < 1_000_000 else 0


def _mtime(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def _by_name(item: tuple[str, Any]) -> list[Any]:
    """`two-2-10` after `two-2-9`."""
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in item[0].split("-")]

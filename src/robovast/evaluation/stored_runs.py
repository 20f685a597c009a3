"""Reads the stored runs of a variant from their records, or else from their test results."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from operator import attrgetter
from pathlib import Path
from typing import Any

from robovast.campaign.layout import RUN_RECORD, SCENARIO_CONFIG, VARIANT_RECORD
from robovast.campaign.run_record import RunRecord, parse_known, result_without_record
from robovast.evaluation.summaries import LISTED, RunSummary, VariantRuns
from robovast.evaluation.untrusted_data import mapping, plain, read_yaml
from robovast.model.variations.factors import factor_units, factor_values

LARGEST = 1 << 20
"""Largest record that is read [bytes]."""
_USUAL = 1 << 14
"""A record is hardly ever larger [bytes]; room for the largest one would cost time for each."""
_listed = attrgetter(*LISTED)
_RUN = re.compile(r"0|[1-9][0-9]{0,8}")


def read_variant(results: Path, campaign: str, name: str) -> VariantRuns:
    """A variant with its runs; links are not followed.

    Raises:
        OSError: its folder cannot be read.
    """
    with _folder(f"{results}/{campaign}/{name}") as variant:
        numbers = sorted(int(entry.name) for entry in os.scandir(variant) if _is_run(entry))
        records = [(number, _read_record(variant, number)) for number in numbers]
    first = next((record for _, record in records if record is not None), None)
    if first is not None:
        parameters, factors = _bounded(first.parameters), _bounded(first.factors)
    else:
        parameters = _configured(results, campaign, name)
        factors = mapping(read_yaml(results, f"{campaign}/{name}/{VARIANT_RECORD}").get("factors"))
    runs = [
        _from_record(number, record)
        if record is not None
        else _from_test_result(results / campaign / name / str(number), number)
        for number, record in records
    ]
    entry = first.entry if first is not None else ""
    stated, units = factor_values(factors), factor_units(factors)
    return VariantRuns(name, entry or name, parameters, tuple(runs), stated, units)


def read_parameters(results: Path, campaign: str, name: str) -> Mapping[str, Any]:
    """The parameters of a variant as `read_variant` has them; empty if it cannot be read."""
    try:
        with _folder(f"{results}/{campaign}/{name}") as variant:
            numbers = sorted(int(entry.name) for entry in os.scandir(variant) if _is_run(entry))
            for number in numbers:
                record = _read_record(variant, number)
                if record is not None:
                    return _bounded(record.parameters)
        return _configured(results, campaign, name)
    except OSError:  # it was removed
        return {}


def _configured(results: Path, campaign: str, name: str) -> Mapping[str, Any]:
    """The parameters in the scenario's configuration file."""
    scenarios = read_yaml(results, f"{campaign}/{name}/{SCENARIO_CONFIG}")
    return next(map(mapping, scenarios.values()), {})


@contextmanager
def _folder(path: str) -> Iterator[int]:
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _is_run(entry: os.DirEntry[str]) -> bool:
    return bool(_RUN.fullmatch(entry.name)) and entry.is_dir(follow_symlinks=False)


def _read_record(variant: int, number: int) -> RunRecord | None:
    """A run's record; None if it is missing or unreadable."""
    flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    try:
        descriptor = os.open(f"{number}/{RUN_RECORD}", flags, dir_fd=variant)
    except OSError:
        return None
    try:
        content = os.read(descriptor, _USUAL)
        if len(content) == _USUAL:
            content += os.read(descriptor, LARGEST - _USUAL)
        return parse_known(content)
    except OSError:
        return None
    finally:
        os.close(descriptor)


def _from_record(number: int, record: RunRecord) -> RunSummary:
    """The summary of a run; its folder gives the number, whatever the record says."""
    _, *others = _listed(record)
    return RunSummary.of(number, *others)


def _from_test_result(folder: Path, number: int) -> RunSummary:
    """A run without a record, made by another tool."""
    result = result_without_record(folder)
    known = (result.verdict, result.reason, result.started_at, result.duration)
    return RunSummary.of(number, *known, *[None] * (len(LISTED) - len(known) - 1))


def _bounded(parameters: Mapping[str, Any]) -> Mapping[str, Any]:
    try:
        return mapping(plain(parameters))
    except ValueError:
        return {}

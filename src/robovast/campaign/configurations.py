"""Reads and writes variants in `_transient/configurations.yaml`."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from robovast.base.errors import InputError
from robovast.base.file_errors import obstacle
from robovast.base.serialization import fingerprint
from robovast.base.yaml_files import read_mapping
from robovast.campaign.layout import Layout
from robovast.model.variant import ConfigFile, Variant, VariationRecord
from robovast.model.variations.factors import FACTORS

_OWN_KEYS = frozenset({"name", "config", "_config_name", "_config_files", "_variations", FACTORS})


def read_configurations(layout: Layout) -> dict[str, Any]:
    """The content of `configurations.yaml`.

    Raises:
        InputError: the folder is not a campaign, or the file is damaged.
    """
    path = layout.configurations
    found = obstacle(layout.root)
    if found:
        raise InputError(f"{layout.root} is not a campaign's folder: {found}.")
    data = read_mapping(path)
    if not path.exists():
        raise InputError(
            f"{layout.root} is not a campaign's folder: {path.relative_to(layout.root)} is missing."
        )
    if not isinstance(data.get("configs"), list):
        raise InputError(f"{path}: has no list of configurations.")
    return data


def read_variants(layout: Layout) -> tuple[str, list[Variant]]:
    """The name of the .vast file in `_config`, and the campaign's variants in order."""
    data = read_configurations(layout)
    return str(data.get("vast")), [variant_of(layout, item) for item in data["configs"]]


def configuration_record(variant: Variant, *, timings: bool) -> dict[str, Any]:
    """A variant's entry in `configurations.yaml`.

    Args:
        variant: the variant.
        timings: include when each variation was applied and how long it took; without timings,
            equal variants have equal records.
    """
    return {
        "name": variant.name,
        "config": dict(variant.parameters),
        "_config_name": variant.entry,
        "_config_files": [file.name for file in variant.files],
        "_variations": [
            {"name": r.name, "started_at": r.started_at, "duration": r.duration}
            if timings
            else {"name": r.name}
            for r in variant.variations
        ],
        **({FACTORS: dict(variant.factors)} if variant.factors else {}),
        **variant.extra,
    }


def variants_digest(variants: Iterable[Variant]) -> str:
    """SHA-256 of variants; equal variants have equal digests in all versions that expand alike.

    Factors, which describe a variant and change nothing in it, do not count.
    """
    whole = hashlib.sha256()
    for variant in variants:
        record = configuration_record(replace(variant, factors={}), timings=False)
        whole.update(fingerprint(record).encode())
    return whole.hexdigest()


def variant_of(layout: Layout, item: Mapping[str, Any]) -> Variant:
    """The variant in a `configuration_record`."""
    name = item["name"]
    files = layout.variant_config(name)
    return Variant(
        name=name,
        entry=item.get("_config_name", name),
        parameters=item.get("config") or {},
        files=tuple(
            ConfigFile(str(file), files / str(file)) for file in item.get("_config_files") or ()
        ),
        variations=tuple(
            VariationRecord(v["name"], str(v.get("started_at", "")), v.get("duration", 0.0))
            for v in item.get("_variations") or ()
        ),
        extra={key: value for key, value in item.items() if key not in _OWN_KEYS},
        factors=item.get(FACTORS) or {},
    )

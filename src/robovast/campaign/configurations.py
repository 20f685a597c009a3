"""Reads and writes variants in `_transient/configurations.yaml`.

A campaign may come from anywhere, so every reader gets what the models below accept: names are
single parts of a path, and paths of files stay in their folder.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, ValidationError
from pydantic_core import PydanticCustomError

from robovast.base.errors import InputError
from robovast.base.file_errors import obstacle
from robovast.base.printable import is_printable
from robovast.base.serialization import fingerprint
from robovast.base.yaml_files import read_mapping
from robovast.campaign.layout import Layout, is_variant
from robovast.model.document.source import render_path
from robovast.model.variant import ConfigFile, Variant, VariationRecord
from robovast.model.variations.factors import FACTORS

_ModelT = TypeVar("_ModelT", bound=BaseModel)

_LONGEST_NAME = 255
"""Longest part of a path in Linux [byte]."""
_LONGEST_PATH = 4095
"""Longest path in Linux [byte]."""


def _one_name(name: str) -> str:
    if name and "/" not in name and is_variant(name) and len(name.encode()) <= _LONGEST_NAME:
        return name
    raise PydanticCustomError("name", "must be the name of a folder for a configuration's runs")


def _inside(path: str) -> str:
    pure = PurePosixPath(path)
    fits = len(path) <= _LONGEST_PATH and is_printable(path)
    fits = fits and all(len(part.encode()) <= _LONGEST_NAME for part in pure.parts)
    if fits and pure.name and not pure.is_absolute() and ".." not in pure.parts:
        return path
    raise PydanticCustomError("inside", "must be the path of a file in the campaign's `_config`")


def _name_in_pair(file: Any) -> Any:
    """The relative path in a pair `[relative, absolute]`, as other tools list files."""
    return file[0] if isinstance(file, list | tuple) and len(file) == 2 else file


_Name = Annotated[str, AfterValidator(_one_name)]
_Inside = Annotated[str, AfterValidator(_inside)]
_File = Annotated[_Inside, BeforeValidator(_name_in_pair)]


class _Variation(BaseModel, defer_build=True):
    name: str
    started_at: Any = ""
    duration: float | None = None


class _Configuration(BaseModel, extra="allow", defer_build=True):
    name: _Name
    config: dict[str, Any] | None = None
    entry: str | None = Field(None, alias="_config_name")
    files: list[_File] | None = Field(None, alias="_config_files")
    variations: list[_Variation] | None = Field(None, alias="_variations")
    factors: dict[str, Any] | None = Field(None, alias=FACTORS)


class _Configurations(BaseModel, defer_build=True):
    """What `configurations.yaml` must be."""

    vast: _Inside | None = None
    configs: list[_Configuration]
    input_files: list[_Inside] | None = Field(None, alias="_input_files")
    run_files: list[_Inside] | None = Field(None, alias="_run_files")


def read_configurations(layout: Layout) -> dict[str, Any]:
    """The content of `configurations.yaml`.

    Raises:
        InputError: the folder is not a campaign, or the file is damaged.
    """
    path = layout.configurations
    found = obstacle(layout.root)
    if found:
        raise InputError(
            f"{layout.root} is not a campaign's folder: {found}.",
            hint="name the folder of a campaign",
        )
    data = read_mapping(path)
    if not os.path.exists(path):
        raise InputError(
            f"{layout.root} is not a campaign's folder: {path.relative_to(layout.root)} is "
            "missing.",
            hint="name the folder of a campaign, or download the campaign again",
        )
    _validated(_Configurations, data, path)
    return data


def document_path(layout: Layout, configurations: Mapping[str, Any]) -> Path:
    """The path of a campaign's .vast file.

    Raises:
        InputError: `configurations.yaml` does not name it.
    """
    if configurations.get("vast") is None:
        raise InputError(
            f"{layout.configurations}: is damaged: `vast`: must be the name of the .vast file.",
            hint="download the campaign again",
        )
    return layout.config / str(configurations["vast"])


def read_variants(layout: Layout) -> list[Variant]:
    """The campaign's variants in order; see `read_configurations`."""
    return variants_in(layout, read_configurations(layout))


def variants_in(layout: Layout, configurations: Mapping[str, Any]) -> list[Variant]:
    """The variants in the content of `configurations.yaml`."""
    return [variant_of(layout, item) for item in configurations["configs"]]


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


def variant_of(layout: Layout, item: Any) -> Variant:
    """The variant in a `configuration_record`.

    Raises:
        InputError: it is damaged, or names files outside of the variant's folder.
    """
    found = _validated(_Configuration, item, layout.configurations)
    folder = layout.variant_config(found.name)
    return Variant(
        name=found.name,
        entry=found.entry or found.name,
        parameters=found.config or {},
        files=tuple(ConfigFile(file, folder / file) for file in found.files or ()),
        variations=tuple(
            VariationRecord(v.name, str(v.started_at), v.duration or 0.0)
            for v in found.variations or ()
        ),
        extra=found.model_extra or {},
        factors=found.factors or {},
    )


def with_stored_files(layout: Layout, variant: Variant) -> Variant:
    """The variant with the campaign's copies of its files."""
    folder = layout.variant_config(variant.name)
    files = tuple(ConfigFile(file.name, folder / file.name) for file in variant.files)
    return replace(variant, files=files)


def _validated(model: type[_ModelT], data: Any, path: Path) -> _ModelT:
    try:
        return model.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = f"`{render_path(first['loc'])}`: " if first["loc"] else ""
        raise InputError(
            f"{path}: is damaged: {place}{first['msg']}", hint="download the campaign again"
        ) from None

"""Identifiers of a configuration: equal identifiers mean equal inputs.

Merging compares them, so they depend on content only, never on time or place.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path
from typing import Any

from robovast.base.serialization import fingerprint, to_plain
from robovast.model.document import Document
from robovast.model.document.files import run_files
from robovast.model.expansion import Variant

_NO_FILES = fingerprint({})
_NO_VARIATIONS = fingerprint([])


class Identities:
    """Computes the identifiers of one document's variants; shared parts are computed once."""

    def __init__(self, document: Document) -> None:
        folder = document.folder
        names = run_files(folder, document.vast.execution.run_files)
        self._run_files = fingerprint({str(name): _digest(folder / name) for name in names})
        self._scenario_file = _digest(document.scenario)
        self._variations = {
            entry.name: fingerprint([call.name for call in entry.variations or []])
            for entry in document.vast.configuration or []
        }

    def of(self, variant: Variant) -> dict[str, Any]:
        """`{config_identifier, sub_identifier}` of a variant, as in its `config.yaml`."""
        parts = {
            "block": fingerprint(to_plain(variant.parameters)),
            "run_files": self._run_files,
            "scenario_file": self._scenario_file,
            "config_referenced_files": fingerprint(
                {file.name: _digest(file.source) for file in variant.files}
            )
            if variant.files
            else _NO_FILES,
            "variation_entrypoints": self._variations.get(variant.entry, _NO_VARIATIONS),
        }
        return {"config_identifier": fingerprint(parts), "sub_identifier": parts}


@lru_cache(maxsize=4096)
def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()

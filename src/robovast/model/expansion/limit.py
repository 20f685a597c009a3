"""Limits the number of variants of a document, which are counted before they are made."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path

from robovast.base.errors import InputError
from robovast.model.designs import count_of
from robovast.model.document import Document
from robovast.model.document.model import ConfigurationEntry
from robovast.model.expansion.designed import design_sizes
from robovast.model.variations.loader import most_of_each

VARIABLE = "ROBOVAST_VARIANT_LIMIT"
"""Environment variable that overrides the limit."""
DEFAULT = 100_000
UNCOUNTABLE = 10**18
"""Larger numbers are shown as this one."""


def variant_limit(environment: Mapping[str, str] = os.environ) -> int:
    """Most variants that a document may have.

    Raises:
        InputError: the environment variable is not a number above 0.
    """
    text = environment.get(VARIABLE, "") or str(DEFAULT)
    if not (text.isdecimal() and int(text[:10]) > 0 and len(text) <= 9):
        raise InputError(
            f"The environment variable {VARIABLE} is not a number above 0: {text}",
            hint="set it to a number above 0, or unset it",
        )
    return int(text)


def refuse_too_many(document: Document, limit: int) -> None:
    """Refuse a document that has too many variants, before any of them is made.

    Raises:
        InputError: the document has too many variants.
    """
    entries = document.vast.configuration or []
    counted = [(count_entry(document, entry), entry) for entry in entries]
    total = sum(number for number, _ in counted)
    if total > limit:
        number, entry = max(counted, key=lambda item: item[0])
        raise too_many(document.path, total, limit, f"`{entry.name}` alone has {number:,}")


def too_many(path: Path, total: int, limit: int, detail: str) -> InputError:
    """The error about too many variants."""
    return InputError(
        f"{path}: would have {total:,} configurations, more than {limit:,}: {detail}. Variations "
        "that follow one another multiply",
        hint="use OneOfVariation where they need not, give fewer values, or set another limit "
        f"({VARIABLE}; on a cluster the chart's value `operator.variantLimit`)",
    )


def count_entry(document: Document, entry: ConfigurationEntry) -> int:
    """Most variants that an entry may have; variation types that cannot tell count as one."""
    calls = entry.variations or []
    if entry.design is not None:
        return count_of(entry.design, design_sizes(entry, document.folder))
    factors = (most_of_each(call.name, call.parameters, document.folder) for call in calls)
    return min(UNCOUNTABLE, math.prod(factors))

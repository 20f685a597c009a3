"""Selects variants by name."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import TypeAlias

from robovast.base.errors import InputError
from robovast.model.variant import Variant

Selection: TypeAlias = str | Sequence[str] | None
"""A name or glob, or several of them; None selects all."""


def select_variants(variants: Sequence[Variant], pattern: str) -> list[Variant]:
    """Variants whose name or entry name equals the pattern or matches it as a glob.

    Raises:
        InputError: no variant matches.
    """
    chosen = [v for v in variants if v.name == pattern or v.entry == pattern]
    if not chosen:
        chosen = [
            v for v in variants if fnmatchcase(v.name, pattern) or fnmatchcase(v.entry, pattern)
        ]
    if chosen:
        return chosen
    names = list(dict.fromkeys([v.entry for v in variants] + [v.name for v in variants]))
    near = difflib.get_close_matches(pattern, names, n=3) or names[:5]
    raise InputError(
        f"no configuration matches `{pattern}`. There are {len(variants)}, for example "
        f"{', '.join(near)}; `vast config list` shows all."
    )


def select_any(variants: Sequence[Variant], selection: Selection) -> list[Variant]:
    """Variants that match a pattern or any of several, in their order; no pattern selects all.

    Raises:
        InputError: a pattern matches no variant.
    """
    patterns = patterns_of(selection)
    chosen = {v.name for pattern in patterns for v in select_variants(variants, pattern)}
    return [v for v in variants if v.name in chosen or not patterns]


def patterns_of(selection: Selection) -> list[str]:
    """The patterns of a selection; none selects all."""
    return [selection] if isinstance(selection, str) else list(selection or ())

"""Selects variants by name, or every so many of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import TypeAlias

from robovast.base.errors import InputError
from robovast.model.variant import Variant

Selection: TypeAlias = str | Sequence[str] | None
"""A name or glob, or several of them; `N/M` of them the N-th of M parts; None selects all."""

_PART = re.compile(r"0*(\d{1,9})/0*([1-9]\d{0,8})")
"""No name of a configuration has a slash."""


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
    from difflib import get_close_matches

    names = list(dict.fromkeys([v.entry for v in variants] + [v.name for v in variants]))
    near = get_close_matches(pattern, names, n=3) or names[:5]
    raise InputError(
        f"no configuration matches `{pattern}` ({len(variants)} available)",
        hint=f"use for example {', '.join(near)}, or run `vast config list` to see all",
    )


def select_any(variants: Sequence[Variant], selection: Selection) -> list[Variant]:
    """Variants that match a pattern or any of several, in their order; no pattern selects all.

    A pattern `2/3` selects of those the second, the fifth, the eighth and so on: the second of
    three parts that are as equal as possible, and have all of them together.

    Raises:
        InputError: a pattern matches no variant.
    """
    patterns = patterns_of(selection)
    parts = [match for match in map(_PART.fullmatch, patterns) if match]
    names = [pattern for pattern in patterns if not _PART.fullmatch(pattern)]
    chosen = {v.name for pattern in names for v in select_variants(variants, pattern)}
    found = [v for v in variants if v.name in chosen or not names]
    for part in parts:
        found = _part_of(found, part)
    return found


def _part_of(variants: Sequence[Variant], part: re.Match[str]) -> list[Variant]:
    pattern, number, of = part[0], int(part[1]), int(part[2])
    if not 1 <= number <= of:
        raise InputError(
            f"invalid part `{pattern}`: the number must be between 1 and {of}",
            hint=f"use for example `1/{of}`",
        )
    if number > len(variants):
        raise InputError(
            f"`{pattern}`: this part is empty, because there are only {len(variants)} "
            "configurations",
            hint="use at most this number of parts",
        )
    return list(variants[number - 1 :: of])


def patterns_of(selection: Selection) -> list[str]:
    """The patterns of a selection; none selects all."""
    return [selection] if isinstance(selection, str) else list(selection or ())

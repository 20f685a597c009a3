"""Which cells of a CSV file are numbers: those that a number can give back as they are written.

`1_1`, `007`, `+5`, ` 5`, `1.10`, `1e5`, a commit hash such as `5e10293` and numbers with more
digits than a `DOUBLE` has are text. Numbers are what programs write for numbers:

- whole numbers, such as `-12`
- the shortest digits of a `DOUBLE`, with or without `.0`: `0.1`, `3.0`, `1e-05`, `1.0E-5`
- the formats `%.16g` and `%.17g`, and the formats `%.18e` of NumPy and `%e` of C
- `nan`, `NaN`, `inf`, `-inf`
- fixed decimals, at least three, as many in each cell of a column: `0.100`, `1700000000.123456789`
"""

from __future__ import annotations

import re
from typing import Final

_WHOLE: Final = r"0|-?[1-9][0-9]{0,38}"
_SHORT: Final = (
    r"-?(?:0|[1-9][0-9]*)(?:\.(?:0|[0-9]*[1-9]))?"
    r"|-?[1-9](?:\.(?:0|[0-9]*[1-9]))?[eE](?:-0?[5-9]|-[1-9][0-9]{1,2}|\+0[6-9]|\+[1-9][0-9]{1,2})"
)
"""Decimals without needless zeros; with an exponent where writers begin to use one."""
_PADDED: Final = r"-?[0-9]\.[0-9]+e[-+][0-9]{2,3}"
_FIXED: Final = r"-?(?:0|[1-9][0-9]*)\.[0-9]{3,}"
_SPECIAL: Final = ("nan", "NaN", "inf", "-inf")
_SAFE: Final = 15
"""Decimal digits that every `DOUBLE` keeps."""
_NORMAL: Final = ("1e-300", "1e300")
"""Range in which a `DOUBLE` keeps them."""
LARGEST_EXACT: Final = 2**53
"""Whole numbers up to here are exact as `DOUBLE`."""
_MOST_DIGITS: Final = 38
"""Most digits of `HUGEINT` and `DECIMAL`."""


def number_in(cell: str, *, rounded: bool = False) -> int | float | None:
    """The number that a cell is by itself; None if it is text.

    Args:
        cell: the cell.
        rounded: whether fixed decimals may have more digits than a float keeps, as in plots.
    """
    if re.fullmatch(_WHOLE, cell):
        return int(cell)
    if cell in _SPECIAL:
        return float(cell)
    if re.fullmatch(_SHORT, cell):
        value, (least, most) = float(cell), map(float, _NORMAL)
        if len(re.sub(r"[eE].*|[^0-9]", "", cell)) <= _SAFE and least < abs(value) < most:
            return value
        shortest = repr(value)
        forms = {shortest, shortest.removesuffix(".0"), f"{value:.16g}", f"{value:.17g}"}
        return value if cell in forms else None
    if re.fullmatch(_FIXED, cell) and (rounded or sum(map(str.isdigit, cell)) <= _SAFE):
        return float(cell)
    if re.fullmatch(_PADDED, cell):
        value = float(cell)
        return value if cell in (f"{value:.18e}", f"{value:.6e}") else None
    return None


def is_double(cell: str) -> str:
    """An SQL condition: a column's cell is a `DOUBLE`, as `number_in` has it.

    Args:
        cell: SQL of the cell, a text.
    """
    value = f"TRY_CAST({cell} AS DOUBLE)"
    digits = f"length(regexp_replace({cell}, '[eE].*|[^0-9]', '', 'g'))"
    least, most = _NORMAL
    return (
        f"({cell} IN {_SPECIAL} OR (regexp_full_match({cell}, '{_SHORT}') AND "
        f"(({digits} <= {_SAFE} AND abs({value}) > {least} AND abs({value}) < {most}) "
        f"OR {cell} IN ({value}::VARCHAR, {plain(value)}, "
        f"format('{{:.16g}}', {value}), format('{{:.17g}}', {value})))) "
        f"OR (regexp_full_match({cell}, '{_PADDED}') AND "
        f"{cell} IN (format('{{:.18e}}', {value}), format('{{:.6e}}', {value}))))"
    )


def plain(value: str) -> str:
    """SQL of the shortest text of a `DOUBLE`, without `.0`."""
    text = f"{value}::VARCHAR"
    return f"CASE WHEN suffix({text}, '.0') THEN left({text}, -2) ELSE {text} END"


def is_whole(cell: str) -> str:
    """An SQL condition: a cell is a `HUGEINT`."""
    return f"(regexp_full_match({cell}, '{_WHOLE}') AND TRY_CAST({cell} AS HUGEINT) IS NOT NULL)"


def fixed_type(cell: str) -> str:
    """SQL of the type of a column with equally many fixed decimals in each cell, else NULL.

    A `DECIMAL` gives each cell back as written, except `-0.000`.
    """
    is_fixed = f"regexp_full_match({cell}, '{_FIXED}') AND length({cell}) <= {_MOST_DIGITS}"
    places = f"length({cell}) - strpos({cell}, '.')"
    return (
        f"CASE WHEN bool_and({is_fixed}) AND min({places}) = max({places}) THEN "
        f"CASE WHEN NOT bool_or(regexp_full_match({cell}, '-[0.]+')) "
        f"THEN 'DECIMAL(38,' || min({places}) || ')' "
        f"WHEN max(length({cell})) <= {_SAFE + 1} THEN 'DOUBLE' END END"
    )


def type_of(values: list[object]) -> str:
    """The SQL type that keeps values that have types already, such as those of parameters."""
    kinds = {type(value) for value in values if value is not None}
    whole = [abs(value) for value in values if isinstance(value, int)]
    largest = max(whole, default=0)
    if kinds == {bool}:
        return "BOOLEAN"
    if kinds <= {int} and largest < 2**127:
        return "BIGINT" if largest < 2**63 else "HUGEINT"
    return "DOUBLE" if kinds <= {int, float} and largest <= LARGEST_EXACT else "VARCHAR"

"""What is wrong with a query: DuckDB finds it, and says it to people who write databases."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches

Columns = Mapping[str, Iterable[str]]
"""Of each table."""

ONLY_READS = (
    "a query reads the tables of campaigns (SELECT, DESCRIBE, SUMMARIZE, SHOW TABLES); it can "
    "change nothing and open no other file."
)
MOST_NAMED = 20
"""Columns or tables that a message names."""

_LINE = re.compile(r"^LINE \d+: (?P<text>.*)\n {8}(?P<mark> *\^+)", re.MULTILINE)
_KIND = re.compile(r"^[A-Z][\w ]*? Error: ")
_ADVICE = re.compile(
    r"(?<=[.!,;]) *(Use|Try|Please|Did you|In order to|You (might|may|can)|Consider|SET)\b.*"
    r"| *\((use|explicitly) .*\)"
)
_PATH = re.compile(r"(\b(?:file|database|directory|path) [\"'])/[^\"']*/")
_OWN_NAMES = re.compile(r"\b(memory\.main|system\.main|campaign_\d+(\.main)?)\.")
_WORDS = ("SELECT", "FROM", "WHERE", "GROUP", "HAVING", "ORDER", "LIMIT", "JOIN", "DISTINCT")


@dataclass(frozen=True)
class _Fault:
    """What is wrong, as a rule sees it."""

    found: re.Match[str]
    """Of the rule's pattern, in DuckDB's message."""
    sql: str
    columns: Columns


def explained(cause: str, sql: str, columns: Columns) -> str:
    """What is wrong with a query, where, and what would be right.

    Args:
        cause: DuckDB's message.
        sql: the query.
        columns: of the tables that can be asked.
    """
    faults = ((re.search(pattern, cause), rule) for pattern, rule in _RULES.items())
    text = next(
        (rule(_Fault(found, sql, columns)) for found, rule in faults if found), _other(cause)
    )
    place = _LINE.search(cause)
    where = f"\n    {place['text']}\n    {place['mark']}" if place else ""
    return f"the query is wrong: {text}{where}"


def _other(cause: str) -> str:
    """What DuckDB says, without the names of its own things, and without advice about them."""
    first = _KIND.sub("", cause.strip()).partition("\n")[0]
    plain = _ADVICE.sub("", _PATH.sub(r"\1", _OWN_NAMES.sub("", first))).rstrip(".,:;! ")
    return f"it cannot be answered. DuckDB says: {plain}."


def _no_table(fault: _Fault) -> str:
    name = fault.found["name"]
    hint = _near(name, fault.columns) or f"There are {_listed(fault.columns)}."
    return f"there is no table `{name}`. {hint}"


def _no_column(fault: _Fault) -> str:
    name = fault.found["name"]
    asked = [table for table in fault.columns if re.search(rf"\b{re.escape(table)}\b", fault.sql)]
    asked = asked or list(fault.columns)
    known = dict.fromkeys(column for table in asked for column in fault.columns[table])
    hint = _near(name, known) or (
        f"A text stands in single quotes; columns of {' and '.join(asked)} are {_listed(known)}."
    )
    return f"there is no column `{name}`. {hint}"


def _near(name: str, known: Iterable[str]) -> str:
    folded = {one.casefold(): one for one in known}
    near = get_close_matches(name.casefold(), folded, 1, 0.65)  # `passed` is not meant as `seed`
    return f"Did you mean `{folded[near[0]]}`?" if near else ""


def _listed(names: Iterable[str]) -> str:
    every = sorted(names)
    more = f" and {len(every) - MOST_NAMED} more" if len(every) > MOST_NAMED else ""
    return f"{', '.join(every[:MOST_NAMED])}{more}"


def _no_sql(fault: _Fault) -> str:
    word, place = fault.found["word"], _LINE.search(fault.found.string)
    before = place["text"][: place["mark"].index("^")] if place else ""
    for one in (word, *re.findall(r"\w+", before)[-1:]):
        near = get_close_matches(one.upper(), _WORDS, 1, 0.7)
        if near and near[0] != one.upper():
            return f"`{one}` is not understood here. Did you mean {near[0]}?"
    if fault.sql.rstrip("; \n\t").endswith(word) and not fault.sql.startswith(word):
        return f"it ends too early, after `{word}`: a name, a condition or a bracket is missing."
    return (
        f"it is not understood from `{word}` on; something before it is missing or too much. A "
        "query has this order: SELECT, FROM, WHERE, GROUP BY, HAVING, ORDER BY, LIMIT."
    )


def _no_function(fault: _Fault) -> str:
    near = re.search(r'Did you mean "([^"]+)"', fault.found.string)
    hint = f" Did you mean `{near[1]}`?" if near else ""
    return f"there is no function `{fault.found['name']}`.{hint}"


def _wrong_types(fault: _Fault) -> str:
    types = [_type(name) for name in re.split(r", (?![^(]*\))", fault.found["types"])]
    castable = "text" in types and "DOUBLE" in fault.found.string
    hint = " `try_cast(… AS DOUBLE)` makes a number of a text." if castable else ""
    return f"`{fault.found['name']}` cannot be applied to {' and '.join(types)}.{hint}"


def _no_value(fault: _Fault) -> str:
    column = re.search(r"source column (\w+)", fault.found.string)
    if column and (number := _compared_number(column[1], fault.sql)):
        return (
            f"`{column[1]}` is text, and `{fault.found['value']}` is not "
            f"{_type(fault.found['type'])}: compare `{column[1]}` with '{number}', in quotes."
        )
    return (
        f"`{fault.found['value']}` is not {_type(fault.found['type'])}. `try_cast(… AS …)` gives "
        "NULL for what cannot be converted."
    )


def _compared_number(column: str, sql: str) -> str:
    """The number that a query compares with a column, on either side; empty if there is none."""
    name, number, sign = rf'\b{column}\b"?', r"([+-]?\d+(?:\.\d+)?)", r"(?:[=<>!]+|IN\s*\()"
    either = rf"{name}\s*{sign}\s*{number}|{number}\s*{sign}\s*\"?(?:\w+\.)?{name}"
    found = re.search(either, sql, re.IGNORECASE)
    return (found[1] or found[2]) if found else ""


def _type(name: str) -> str:
    kinds = {
        r".*\[\]|.*LIST.*": "a list",
        r"VARCHAR.*|STRING.*": "text",
        r"DOUBLE|FLOAT|DECIMAL.*": "a number",
        r"U?(TINY|SMALL|BIG|HUGE)?INT(EGER)?(_LITERAL|\d+)?": "a whole number",
        r"BOOL.*": "true or false",
        r"TIMESTAMP.*|DATE|TIME.*": "a time",
    }
    return next((kind for pattern, kind in kinds.items() if re.fullmatch(pattern, name)), name)


def _say(text: str) -> Callable[[_Fault], str]:
    """A rule that says the same of every query, with what its pattern has found."""
    return lambda fault: text.format(**fault.found.groupdict())


_RULES: Mapping[str, Callable[[_Fault], str]] = {
    r"Table with name (?P<name>.+) does not exist": _no_table,
    r'Referenced column "(?P<name>.+?)" not found': _no_column,
    r'does not have a column named "(?P<name>.+?)"': _no_column,
    r'Column "(?P<name>.+?)" does not exist on \w+ side of join': _no_column,
    r'Referenced table "(?P<name>.+?)" not found': _say(
        "FROM names no table `{name}`, neither by name nor by alias (`FROM runs AS r`)."
    ),
    r'syntax error at or near "(?P<word>.+?)"': _no_sql,
    r"syntax error at end of input": _say(
        "it ends too early: a name, a condition or a bracket is missing."
    ),
    r"unterminated": _say("a quote is not closed: 'text' and \"column\" end as they begin."),
    r'column "(?P<name>.+?)" must appear in the GROUP BY': _say(
        "`{name}` has many values where one is wanted: write GROUP BY {name}, or take any of them "
        "with any_value({name})."
    ),
    r"Division by zero": _say(
        "it divides by zero: `nullif(…, 0)` as divisor gives NULL in place of a result."
    ),
    r"^Out of Range Error: (Overflow|Value out of range)": _say(
        "a whole number becomes too large; `CAST(… AS DOUBLE)` computes with other numbers."
    ),
    r"Cannot create a string of size|Lists larger than": _say(
        "it makes a text or list that is too large for any memory."
    ),
    r"SELECT clause without selection list": _say("SELECT is followed by columns, or by `*`."),
    r"LIMIT/OFFSET cannot be negative": _say("LIMIT and OFFSET are numbers from 0."),
    r"^(Conversion|Invalid Input) Error: ((?i:date|time|timestamp)\b.* out of range"
    r"|invalid (date|time|timestamp) field|Could not parse string)": _say(
        "a text is not a time that exists, or not written as such: '2026-01-31 13:00:00'. "
        "`try_cast(… AS TIMESTAMP)` and `try_strptime` give NULL for these."
    ),
    r"Failed to parse format specifier (?P<name>\S+?):": _say(
        "`{name}` is not a format of times; a usual one is '%Y-%m-%d %H:%M:%S'."
    ),
    r'extract specifier "(?P<name>.*?)" not recognized': _say(
        "`{name}` is not a part of a time; year, month, day, hour, minute and second are."
    ),
    r'duplicate alias "(?:memory\.main\.)?(?P<name>.+?)"': _say(
        "`{name}` is named twice in FROM: give each a name of its own (`FROM {name} AS a`)."
    ),
    r'Column "(?P<name>.+?)" in \w+ list not found': _no_column,
    r"Max expression depth": _say("it is nested too deeply."),
    r"argument types '(?P<name>.+?)\((?P<types>.*)\)'": _wrong_types,
    r'for the function call "(?P<name>.+?)\((?P<types>.*)\)"': _wrong_types,
    r"Function with name (?P<name>.+) does not exist": _no_function,
    r'Ambiguous reference to column name "(?P<name>.+?)" \(use: (?P<names>.+)\)': _say(
        "several tables have a column `{name}`: say whose it is ({names})."
    ),
    r"Cannot (compare|mix) values of type (VARCHAR.*(DECIMAL|DOUBLE|INT)"
    r"|.*(DECIMAL|DOUBLE|INT).*VARCHAR)": _say(
        "a text is compared with a number: put the number into single quotes, or convert the text "
        "with `try_cast(… AS DOUBLE)`."
    ),
    r"Could not convert (string )?'(?P<value>.*)' to '?(?P<type>\w+)": _no_value,
    r"with value (?P<value>\S+) can't be cast .* out of range": _say(
        "{value} is too large for its type; BIGINT and DOUBLE hold more."
    ),
    r"clause cannot contain aggregates": _say(
        "WHERE is about single rows: conditions on count() and avg() stand in HAVING."
    ),
    r"ORDER term out of range - should be between 1 and (?P<last>\d+)": _say(
        "a number in ORDER BY counts columns of the answer, here from 1 to {last}."
    ),
    r"Set operations can only": _say(
        "the queries that UNION, EXCEPT or INTERSECT joins need equally many columns."
    ),
    r"More than one row returned by a subquery": _say(
        "a query in brackets has several rows where one value is wanted: add LIMIT 1."
    ),
    r"not provided for the following": _say(
        "`?` and `$name` stand for values that nobody gives: write the values."
    ),
    r"^Invalid Input Error: Required module 'pytz'": _say(
        "a column of the answer is a time with a time zone, as now() is: `now()::TIMESTAMP` is one "
        "without."
    ),
    r"^Permission Error": _say(ONLY_READS),
    r"^Out of Memory Error": _say(
        "it needs more memory than is here: ask for fewer columns or rows."
    ),
}

"""Messages about wrong queries: DuckDB's own, and a remedy for the most frequent mistakes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches

from robovast.base.errors import InputError

Columns = Mapping[str, Iterable[str]]
"""Of each table."""

Rule = tuple[str, str]
"""What is wrong, and what to do."""

ONLY_READS: Rule = (
    "a query can change nothing and open no other file than the tables of campaigns",
    "use SELECT, DESCRIBE, SUMMARIZE or SHOW TABLES",
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


@dataclass(frozen=True)
class _Fault:
    """What is wrong, as a rule sees it."""

    found: re.Match[str]
    """Of the rule's pattern, in DuckDB's message."""
    sql: str
    columns: Columns


def explain_error(cause: str, sql: str, columns: Columns) -> InputError:
    """The error about what is wrong with a query, where, and what would be right.

    Args:
        cause: DuckDB's message.
        sql: the query.
        columns: of the tables that can be asked.
    """
    faults = ((re.search(pattern, cause), rule) for pattern, rule in _RULES.items())
    text, hint = next(
        (rule(_Fault(found, sql, columns)) for found, rule in faults if found), (_other(cause), "")
    )
    place = _LINE.search(cause)
    where = f"\n    {place['text']}\n    {place['mark']}" if place else ""
    return InputError(f"the query is wrong: {text}{where}", hint=hint)


def _other(cause: str) -> str:
    """What DuckDB says, without the names and settings of its own, which users cannot change."""
    first = _KIND.sub("", cause.strip()).partition("\n")[0]
    plain = _ADVICE.sub("", _PATH.sub(r"\1", _OWN_NAMES.sub("", first))).rstrip(".,:;! ")
    return f"DuckDB reports: {plain}."


def _no_table(fault: _Fault) -> Rule:
    name = fault.found["name"]
    hint = _near(name, fault.columns) or f"use one of {_listed(fault.columns)}"
    return f"there is no table `{name}`", hint


def _no_column(fault: _Fault) -> Rule:
    name = fault.found["name"]
    asked = [table for table in fault.columns if re.search(rf"\b{re.escape(table)}\b", fault.sql)]
    asked = asked or list(fault.columns)
    known = dict.fromkeys(column for table in asked for column in fault.columns[table])
    hint = _near(name, known) or (
        f"put text into single quotes. Columns of {' and '.join(asked)} are {_listed(known)}"
    )
    return f"there is no column `{name}`", hint


def _near(name: str, known: Iterable[str]) -> str:
    folded = {one.casefold(): one for one in known}
    near = get_close_matches(name.casefold(), folded, 1, 0.65)  # `passed` is not meant as `seed`
    return f"did you mean `{folded[near[0]]}`?" if near else ""


def _listed(names: Iterable[str]) -> str:
    every = sorted(names)
    more = f" and {len(every) - MOST_NAMED} more" if len(every) > MOST_NAMED else ""
    return f"{', '.join(every[:MOST_NAMED])}{more}"


def _no_value(fault: _Fault) -> Rule:
    column = re.search(r"source column (\w+)", fault.found.string)
    of = f"`{column[1]}` is text, and " if column else ""
    return (
        f"{of}`{fault.found['value']}` cannot be converted to {fault.found['type']}",
        "write a value that is compared with text in single quotes; `try_cast(… AS …)` gives NULL "
        "where that cannot be done",
    )


def _fixed_rule(text: str, hint: str) -> Callable[[_Fault], Rule]:
    """A rule that says the same of every query, with what its pattern has found."""

    def rule(fault: _Fault) -> Rule:
        found = fault.found.groupdict()
        return text.format(**found), hint.format(**found)

    return rule


_RULES: Mapping[str, Callable[[_Fault], Rule]] = {
    r"Table with name (?P<name>.+) does not exist": _no_table,
    r'(Referenced column|a column named|Column) "(?P<name>[^"]+)"'
    r"($|\n| not found| does not exist| in \w+ list not found)": _no_column,
    r'column "(?P<name>.+?)" must appear in the GROUP BY': _fixed_rule(
        "`{name}` has many values where one is wanted",
        "write GROUP BY {name}, or take any of them with any_value({name})",
    ),
    r"Cannot (compare|mix) values of type (VARCHAR.*(DECIMAL|DOUBLE|INT)"
    r"|.*(DECIMAL|DOUBLE|INT).*VARCHAR)": _fixed_rule(
        "a text is compared with a number",
        "put the number into single quotes, or convert the text with `try_cast(… AS DOUBLE)`",
    ),
    r"Could not convert (string )?'(?P<value>.*)' to '?(?P<type>\w+)": _no_value,
    r"^Invalid Input Error: Required module 'pytz'": _fixed_rule(
        "a column of the answer is a time with a time zone",
        "convert it to a time without a time zone, for example `now()::TIMESTAMP` for `now()`",
    ),
    r"^Permission Error": _fixed_rule(*ONLY_READS),
}
"""Faults with a remedy that DuckDB does not name."""

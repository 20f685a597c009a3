"""Answers one SQL or SPARQL query in a separate process.

Queries may take forever or exhaust memory, and may read files from anyone: the process can be
killed while the server continues. Run as a module, it reads the query as JSON from standard input
and prints the answer.
"""

from __future__ import annotations

import json
import re
import resource
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from pathlib import Path
from threading import BoundedSemaphore
from typing import Any, Literal

from robovast.base.errors import CannotRunError, InputError, RobovastError
from robovast.mcp.bounds import MOST_BYTES, fitted, page

TIME_LIMIT = 60.0
"""Time limit of an answer [s]."""
MEMORY = 4 << 30
"""Address space limit of the process [bytes]."""
MOST_ROWS = 1000
"""Most rows of an answer that are read."""

_SEATS = BoundedSemaphore(2)
"""Limits the number of parallel queries."""

_ESCAPE = re.compile(r"\\u([0-9A-Fa-f]{4})|\\U(000[0-9A-Fa-f]{5})")

Kind = Literal["sql", "tables", "sparql"]


def answer(kind: Kind, campaigns: Sequence[Path], text: str = "") -> dict[str, Any]:
    """Answer a query, read-only and limited in size.

    Args:
        kind: kind of query; `tables` lists the tables.
        campaigns: folders of the campaigns.
        text: the query.

    Raises:
        InputError: the query is invalid, there is no data, or it takes too long.
        CannotRunError: the extra `query` is not installed, or the process ended without answer.
    """
    if kind == "sparql" and "service" in _unescaped(text):
        raise InputError(
            "SERVICE would query other servers, which is not allowed here",
            hint="remove that word from the query",
        )
    question = {"kind": kind, "campaigns": [str(path) for path in campaigns], "text": text}
    try:
        with _SEATS:
            done = subprocess.run(
                [sys.executable, "-m", __name__],
                input=json.dumps(question).encode(),
                capture_output=True,
                timeout=TIME_LIMIT,
                check=False,
            )
    except subprocess.TimeoutExpired:
        raise InputError(
            f"the query was ended after {TIME_LIMIT:.0f} s",
            hint="query fewer campaigns or less data",
        ) from None
    if not done.stdout:
        last = done.stderr.decode("utf-8", "replace").strip().rpartition("\n")[2]
        raise CannotRunError(
            f"the query ended without an answer (code {done.returncode}): {last or 'no message'}. "
            "It may need too much memory",
            hint="ask for less",
        )
    found: dict[str, Any] = json.loads(done.stdout)
    if "error" in found:
        raise InputError(found["error"])
    return found


def _unescaped(text: str) -> str:
    """A query in lower case, with SPARQL's escapes resolved."""
    return _ESCAPE.sub(lambda found: chr(int(found[1] or found[2], 16)), text).casefold()


def _sql(campaigns: Sequence[Path], text: str) -> dict[str, Any]:
    from robovast.analysis.tables.query import ask

    found = ask(campaigns, text, MOST_ROWS + 1)
    return _table(found.columns, found.rows)


def _sparql(campaigns: Sequence[Path], text: str) -> dict[str, Any]:
    from robovast.analysis.provenance.query import Graphs

    found = Graphs(campaigns).ask(text)
    return _table(found.columns, list(islice(found, MOST_ROWS + 1)))


def _tables(campaigns: Sequence[Path], _: str) -> dict[str, Any]:
    from robovast.analysis.tables.query import tables

    found = tables(campaigns)
    return page([{"table": name, "columns": types} for name, types in found.items()], name="tables")


def _table(columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> dict[str, Any]:
    shown = page(rows[:MOST_ROWS], name="rows")["rows"]
    found = {"columns": fitted(columns, MOST_BYTES // 2), "rows": shown}
    if len(shown) < len(rows):
        known = f"more than {MOST_ROWS}" if len(rows) > MOST_ROWS else len(rows)
        found["cut"] = f"the first {len(shown)} of {known} rows; aggregate, or use LIMIT and OFFSET"
    return found


_ANSWERS: Mapping[Kind, Callable[[Sequence[Path], str], dict[str, Any]]] = {
    "sql": _sql,
    "tables": _tables,
    "sparql": _sparql,
}


def main() -> None:
    """Answer the question on standard input."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    question = json.load(sys.stdin)
    campaigns = [Path(path) for path in question["campaigns"]]
    try:
        found = _ANSWERS[question["kind"]](campaigns, question["text"])
    except RobovastError as error:
        found = {"error": str(error)[:MOST_BYTES]}
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()

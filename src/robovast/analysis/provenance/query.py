"""SPARQL queries over the graphs of campaigns."""

from __future__ import annotations

import csv
import difflib
import io
import logging
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from robovast.analysis.provenance.vocabulary import PREFIXES
from robovast.base.errors import InputError
from robovast.base.optional_deps import QUERY
from robovast.model.naming import GRAPH

_log = logging.getLogger(__name__)

Row = tuple[Any, ...]
"""One value a column; None where a variable is unbound."""


def query_names() -> dict[str, str]:
    """The built-in queries: name and description."""
    return {name: text.partition("\n")[0].lstrip("# ") for name, text in _queries().items()}


def read_query(name: str) -> str:
    """Text of a built-in query.

    Raises:
        InputError: there is no query of that name.
    """
    known = _queries()
    if name in known:
        return known[name]
    near = difflib.get_close_matches(name, known, n=1)
    use = f"did you mean `{near[0]}`?" if near else f"use one of {', '.join(known)}."
    raise InputError(
        f"there is no query and no file `{name}`",
        hint=f"{use} A query of your own comes from a file, or with `-` from standard input",
    )


def _queries() -> dict[str, str]:
    folder = resources.files(__package__) / "queries"
    files = sorted(folder.iterdir(), key=lambda file: file.name)
    return {f.name.removesuffix(".rq"): f.read_text("utf-8") for f in files if ".rq" in f.name}


class GraphAnswer:
    """Result of a query, for a single iteration: as rows, which are made on demand, or as CSV.

    A cell is text, a number, a boolean or None; IRIs are absolute.
    """

    def __init__(
        self,
        columns: Sequence[str],
        rows: Iterable[Sequence[Any]],
        to_csv: Callable[[], bytes] | None = None,
    ) -> None:
        self.columns = list(columns)
        self._rows = rows
        self._to_csv = to_csv

    def __iter__(self) -> Iterator[Row]:
        return (tuple([_plain(term) for term in row]) for row in self._rows)

    def csv(self) -> str:
        """All rows as CSV with a header and line feeds; faster than iteration."""
        if self._to_csv is not None:
            return self._to_csv().decode().replace("\r\n", "\n")
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows([str(c).lower() if c in (True, False) else c for c in row] for row in self)
        return text.getvalue()


class Graphs:
    """The graphs of several campaigns in memory.

    Args:
        campaigns: folders of campaigns; those without a graph are left out, with a warning.

    Raises:
        InputError: no campaign has a graph, a graph cannot be read, or two share an IRI.
        CannotRunError: the extra `query` is not installed.
    """

    def __init__(self, campaigns: Sequence[Path]) -> None:
        self._engine = _import_engine()
        self._store = self._engine.Store()
        self.campaigns: dict[str, Path] = {}
        """Folder of each campaign by its IRI."""
        with_graph = [campaign for campaign in campaigns if os.path.isfile(campaign / GRAPH)]
        if not with_graph:
            raise InputError(
                f"no campaign has a {GRAPH} ({', '.join(str(c) for c in campaigns)})",
                hint="run `vast results metadata` to write it",
            )
        for campaign in campaigns:
            if campaign in with_graph:
                self._load(campaign / GRAPH)
            else:
                _log.warning(
                    "%s: skipped, because %s is missing; `vast results metadata` writes it",
                    campaign,
                    GRAPH,
                )

    def __len__(self) -> int:
        return len(self._store)

    def ask(self, text: str) -> GraphAnswer:
        """Answer a query; common prefixes need not be declared.

        Results of CONSTRUCT and DESCRIBE have the columns subject, predicate and object; results of
        ASK have the column answer.

        Raises:
            InputError: the query is invalid; the message gives the position and suggestions.
        """
        try:
            result = self._store.query(text, prefixes=PREFIXES)
        except SyntaxError as error:
            cause, expected, _ = str(error).partition(": expected one of")
            if expected:
                cause += ": unexpected text, or something before it is missing"
            raise InputError(f"the query is wrong: {cause}.", hint=_advice(text)) from None
        if isinstance(result, self._engine.QueryBoolean):
            return GraphAnswer(["answer"], [(bool(result),)])
        if isinstance(result, self._engine.QueryTriples):
            return GraphAnswer(["subject", "predicate", "object"], result)
        form = self._engine.QueryResultsFormat.CSV
        columns = [variable.value for variable in result.variables]
        return GraphAnswer(columns, result, lambda: result.serialize(format=form))

    def _load(self, file: Path) -> None:
        try:
            self._store.load(path=str(file), format=self._engine.RdfFormat.JSON_LD)
        except (SyntaxError, ValueError, OSError) as error:
            raise InputError(
                f"{file}: cannot be read: {error}",
                hint="run `vast results metadata` to write the file again",
            ) from None
        found = {row[0] for row in self.ask(_CAMPAIGNS)}
        fresh = found - self.campaigns.keys()
        if not fresh:
            folders = ", ".join(str(folder) for folder in self.campaigns.values())
            raise InputError(
                f"{file.parent} has the same IRI as a loaded campaign ({folders}), so their runs "
                "could not be distinguished",
                hint="query them one by one, or give one another name or another "
                "`metadata.dataset_iri`",
            )
        self.campaigns.update(dict.fromkeys(fresh, file.parent))


_CAMPAIGNS = "SELECT ?campaign WHERE { ?campaign a robovast:Campaign }"


def _import_engine() -> Any:
    with QUERY.needed_by("SPARQL"):
        import pyoxigraph
    return pyoxigraph


_XSD = PREFIXES["xsd"]
_NUMBERS: dict[str, type[int] | type[float]] = {
    **{f"{_XSD}{name}": int for name in ("integer", "int", "long", "nonNegativeInteger")},
    **{f"{_XSD}{name}": float for name in ("decimal", "double", "float")},
}


def _plain(term: Any) -> Any:
    """A term as plain data."""
    if isinstance(term, bool | None):
        return term
    try:
        datatype = term.datatype
    except AttributeError:  # an IRI, a blank node, a triple
        return getattr(term, "value", None) or str(term)
    if datatype.value == f"{_XSD}boolean":
        return term.value in {"true", "1"}
    number = _NUMBERS.get(datatype.value)
    return term.value if number is None else number(term.value)


_COMMENT = re.compile(r"#[^\n<>]*$", re.MULTILINE)
_QUOTED = re.compile(r"\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^'\\])*'|<[^<>\s]*>")


def _advice(text: str) -> str:
    """Suggestions for a query that cannot be parsed."""
    bare = _COMMENT.sub("", _QUOTED.sub("", text))
    missing = bare.count("{") - bare.count("}")
    advice = []
    if missing:
        side, kind = (missing, "}") if missing > 0 else (-missing, "{")
        noun = "is" if side == 1 else "are"
        advice.append(f"{side} `{kind}` {noun} missing.")
    same = next((name for name, own in _queries().items() if _essence(own) == _essence(text)), None)
    if same is not None:
        advice.append(f"`{same}` is the corrected query: `vast results sparql {same}`.")
    used = set(re.findall(r"(?<![\w:])([A-Za-z][\w-]*):[A-Za-z_]", bare))
    declared = set(re.findall(r"(?i)\bprefix\s+([\w-]*):", bare))
    if unknown := sorted(used - declared - PREFIXES.keys()):
        advice.append(f"Unknown prefix: {', '.join(unknown)}; known are {', '.join(PREFIXES)}.")
    return " ".join(advice)


def _essence(text: str) -> str:
    """A query without easily mistyped parts: blanks, comments, dots and braces."""
    return re.sub(r"[\s.{}]+", "", _COMMENT.sub("", text)).lower()

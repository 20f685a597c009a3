"""Tools for the files of campaigns: lists, text, logs, tables."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from fastmcp import FastMCP

from robovast.base.errors import InputError
from robovast.evaluation.confined_files import open_inside
from robovast.evaluation.files import MOST_FILES, list_files
from robovast.evaluation.logs import LogLine, LogQuestion, read_log
from robovast.evaluation.tables import Table, read_table
from robovast.mcp.bounds import MOST_BYTES, fitted, page, size
from robovast.mcp.tools import add_tools

_CHUNK = 20_000
"""Most of a text file in one answer [bytes]."""
_MOST_ROWS = 150
"""Most rows of a CSV file in one answer."""

Level = Literal["debug", "info", "warn", "error", "fatal"]


class ArtifactTools:
    """Files of runs and campaigns."""

    name = "artifacts"

    def __init__(self, results: Path) -> None:
        self._results = results

    def register(self, mcp: FastMCP) -> None:
        """Add the tools to a server."""
        add_tools(
            mcp, self.list_artifacts, self.get_artifact, self.search_run_log, self.get_run_data
        )

    def list_artifacts(self, folder: str, offset: int = 0) -> dict[str, Any]:
        """List the files in and below a folder with their sizes [bytes].

        Args:
            folder: relative to the results folder: a campaign, `<campaign>/_config` (scenario and
                .vast file), `<campaign>/<configuration>/_config`, or
                `<campaign>/<configuration>/<run>`.
            offset: where to continue after a truncated answer.
        """
        files = list_files(self._results, folder)
        items = [{"path": file.path, "kind": file.kind, "size": file.size} for file in files]
        answer = page(items, offset, name="files")
        if len(files) == MOST_FILES:
            answer["note"] = f"only the first {MOST_FILES} files: list folders below this one"
        return answer

    def get_artifact(self, path: str, offset: int = 0) -> dict[str, Any]:
        """Get the text of a file.

        Args:
            path: relative to the results folder, as `list_artifacts` and `get_run` give it.
            offset: where to continue after a truncated answer [bytes].
        """
        begin = max(0, offset)
        with open_inside(self._results, path) as file:
            total = file.seek(0, 2)
            file.seek(begin)
            content = file.read(_CHUNK)
        if b"\0" in content:
            raise InputError(
                f"{path} is not text ({total} bytes).", hint="download the file instead"
            )
        answer = {"text": content.decode("utf-8", "replace"), "total": total}
        if begin + len(content) < total:
            answer["cut"] = (
                f"bytes {begin} to {begin + len(content) - 1} of {total}; continue with "
                f"offset={begin + len(content)}"
            )
        return answer

    def search_run_log(
        self,
        path: str,
        text: str = "",
        levels: list[Level] | None = None,
        before: int = 0,
        end: int = 0,
    ) -> dict[str, Any]:
        """Search a log: its last lines that match, as number, level, text.

        Args:
            path: relative to the results folder, one of `logs` of `get_run`.
            text: only lines with this text, in capitals or not.
            levels: only lines of these levels; by default all.
            before: only lines before this number, 0 for all; continues after a truncated answer.
            end: in a large log, search the part before this offset [bytes]; 0 means the last part.
        """
        question = LogQuestion(
            text, frozenset(levels or ()), before=before or None, end=end or None
        )
        found = read_log(self._results, path, question)
        lines = _last(found.lines)
        answer = {
            "lines": lines,
            "matches": found.matches,
            "total": found.total,
            "levels": found.counts,
        }
        if len(lines) < len(found.lines) or (lines and found.matches > len(found.lines)):
            answer["cut"] = f"earlier lines also match; continue with before={lines[0][0]}"
        if found.begin > 0:
            answer["part"] = (
                f"only bytes {found.begin} to {found.end} of {found.size} were searched, and line "
                f"numbers are relative to them. Search the part before with end={found.begin}"
            )
        return answer

    def get_run_data(self, path: str, columns: list[str] | None = None) -> Any:
        """Get the rows of a CSV file; a large number of rows is thinned out evenly.

        Args:
            path: relative to the results folder, a file of kind `table`.
            columns: names of columns; by default times, places and speeds before others.
        """
        return fitted(_rows(read_table(self._results, path, columns or ())))


def _last(lines: list[LogLine]) -> list[list[Any]]:
    """The last lines that fit into an answer, at least one."""
    kept: list[list[Any]] = []
    left = MOST_BYTES
    for line in reversed(lines):
        item = fitted(line, MOST_BYTES // 2)
        left -= size(item) + 1
        if left < 0:
            break
        kept.append(item)
    return kept[::-1]


def _rows(table: Table) -> dict[str, Any]:
    rows = list(zip(*table.columns.values(), strict=True))
    step = max(1, -(-len(rows) // _MOST_ROWS))
    answer = {
        "all_columns": table.names,
        "columns": list(table.columns),
        "rows": rows[::step],
        "total": table.rows,
    }
    if step * table.stride > 1:
        answer["cut"] = f"one row in {step * table.stride}; `query_run_data` computes over all"
    return answer

"""A small search, whose runs fail where `x` is 50 or more."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

from robovast.execution.local import LocalOptions
from robovast.model.document import load_document
from robovast.search.local import SearchSummary, execute_document
from support.campaigns.local import Recorder, make_campaign

DOCUMENT = """\
version: 1
metadata: {name: test_search}
execution:
  scenario_file: scenario.osc
  run_files: ['files/*']
search:
  search_space:
    x: {type: int, low: 0, high: 100}
"""
FAILS_ABOVE_50 = 'echo "x,y" > "$3/out.csv"; echo "1,$1" >> "$3/out.csv"; [ "$1" -lt 50 ]\n'


def at_random(batches: int) -> str:
    """The rest of the document: so many batches of two."""
    return (
        "  strategy: random\n"
        "  objectives: [{name: failure_rate}]\n"
        "  per_batch: 2\n"
        f"  budget: [{{batches: {batches}}}]\n"
    )


def run_searched(
    folder: Path, extra: str, script: str = FAILS_ABOVE_50, **options: Any
) -> tuple[SearchSummary, Recorder]:
    """Execute a search as plain processes."""
    path = make_campaign(folder, script, extra, document=options.pop("document", DOCUMENT))
    recorder = Recorder()
    chosen = LocalOptions(runtime="process", **options)
    summary = execute_document(load_document(path), folder / "out", chosen, recorder)
    assert isinstance(summary, SearchSummary)
    return summary, recorder


def proposed_values(campaign: Path) -> list[list[dict[str, Any]]]:
    """The values of each batch's sets."""
    files = sorted((campaign / "_execution/search").glob("batch-????.json"))
    return [[item["values"] for item in json.loads(file.read_text())["sets"]] for file in files]


def stored_rows(campaign: Path, query: str) -> list[tuple[Any, ...]]:
    """What `campaign.db` answers."""
    with closing(sqlite3.connect(campaign / "campaign.db")) as connection:
        return connection.execute(query).fetchall()

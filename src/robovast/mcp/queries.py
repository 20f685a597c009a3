"""Tools that query the tables and the provenance of campaigns."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from fastmcp import FastMCP

from robovast.analysis.provenance.query import query_names, read_query
from robovast.base.errors import InputError
from robovast.campaign.layout import COLUMNAR_TABLES
from robovast.evaluation.confined_files import MissingError, resolved
from robovast.evaluation.library import Library
from robovast.mcp.question import answer
from robovast.mcp.tools import add_tools
from robovast.model.naming import GRAPH


class QueryTools:
    """Queries over all runs."""

    name = "queries"

    def __init__(self, library: Library) -> None:
        self._library = library

    def register(self, mcp: FastMCP) -> None:
        """Add the tools to a server."""
        add_tools(
            mcp,
            self.list_run_data_tables,
            self.query_run_data,
            self.list_provenance_queries,
            self.query_provenance,
        )

    def list_run_data_tables(self, campaign: str = "") -> dict[str, Any]:
        """List the tables that `query_run_data` asks, with columns and types.

        Args:
            campaign: name of a campaign; by default all in the results folder.
        """
        return answer("tables", self._having(COLUMNAR_TABLES, campaign))

    def query_run_data(self, sql: str, campaign: str = "") -> dict[str, Any]:
        """Query the tables of campaigns with SQL (DuckDB); nothing can be changed.

        `runs` has a row for each run: campaign, config, run, parameters (`param_…`), factors
        (`factor_…`), verdict, times, metrics. Each CSV name of the runs is a table of its own.

        Args:
            sql: one statement.
            campaign: name of a campaign; by default all in the results folder.
        """
        return answer("sql", self._having(COLUMNAR_TABLES, campaign), sql)

    def list_provenance_queries(self) -> dict[str, str]:
        """List the named queries of `query_provenance` with descriptions."""
        return query_names()

    def query_provenance(self, query: str, campaign: str = "") -> dict[str, Any]:
        """Query the provenance of campaigns (W3C PROV): inputs, tools and activities of each file.

        Args:
            query: a name that `list_provenance_queries` gives, or SPARQL. The prefixes rdf, rdfs,
                xsd, prov, dcterms, dcat, foaf, robovast, smm, scenarios, env, agn, qudt and unit
                need not be declared.
            campaign: name of a campaign; by default all in the results folder.
        """
        text = query if "{" in query else read_query(query)
        return answer("sparql", self._having(GRAPH, campaign), text)

    def _having(self, file: str, campaign: str) -> list[Path]:
        """Folders of the campaigns that contain a file."""
        names = self._library.names()
        if campaign and campaign not in names:
            raise MissingError(
                f"There is no campaign {campaign}", hint="call `list_campaigns` to list them"
            )
        root = self._library.results
        found = [
            root / name for name in ([campaign] if campaign else names) if _has(root, name, file)
        ]
        if not found:
            raise InputError(
                f"no campaign has a {file}", hint="run `vast results postprocess` to write it"
            )
        return found


def _has(root: Path, name: str, file: str) -> bool:
    try:
        return os.path.isfile(resolved(root, f"{name}/{file}"))
    except MissingError:
        return False

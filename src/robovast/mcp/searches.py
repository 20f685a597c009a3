"""Tools for searches: what was proposed by which strategy, and what came of it.

They read what is stored, and never load a strategy or an extractor: those are code of others.
"""

from __future__ import annotations

import os
from typing import Any

from fastmcp import FastMCP

from robovast.base.errors import InputError
from robovast.campaign.layout import SEARCH, Layout
from robovast.evaluation.confined_files import MissingError, resolved
from robovast.evaluation.library import Library
from robovast.mcp.bounds import page
from robovast.mcp.tools import add_tools
from robovast.search.history import Batch, SearchHistory


class SearchTools:
    """Searches, batch by batch and set by set."""

    name = "searches"

    def __init__(self, library: Library) -> None:
        self._library = library

    def register(self, mcp: FastMCP) -> None:
        """Add the tools to a server."""
        add_tools(mcp, self.get_search, self.list_search_sets)

    def get_search(self, campaign: str, offset: int = 0) -> dict[str, Any]:
        """Get the batches of a search: their strategy, its input and its metrics.

        `told` is the number of observed evaluations, all of the first `known` batches. `metrics`
        are numbers of the strategy after the batch, such as the failing fraction of the space.

        Args:
            campaign: its name.
            offset: batches to skip.
        """
        return page([_batch(batch) for batch in self._batches(campaign)], offset, name="batches")

    def list_search_sets(self, campaign: str, offset: int = 0) -> dict[str, Any]:
        """List the parameter sets of a search with their scores, as they were proposed.

        `config` is the configuration whose runs were scored; `error` is the
        reason if a set has no score.

        Args:
            campaign: its name.
            offset: sets to skip.
        """
        rows = [row for batch in self._batches(campaign) for row in _sets(batch)]
        return page(rows, offset, name="sets")

    def _batches(self, campaign: str) -> list[Batch]:
        if campaign not in self._library.names():
            raise MissingError(
                f"There is no campaign {campaign}", hint="call `list_campaigns` to list them"
            )
        root = self._library.results
        if not os.path.isdir(root / campaign / SEARCH):
            raise InputError(
                f"{campaign} is not a search, or has no proposal yet.",
                hint="name a campaign with a search",
            )
        resolved(root, f"{campaign}/{SEARCH}")
        return SearchHistory(Layout(root / campaign)).batches


def _batch(batch: Batch) -> dict[str, Any]:
    made, outcome = batch.proposal, batch.outcome
    return {
        "batch": batch.number,
        "strategy": made.strategy,
        "version": made.version,
        "seed": made.seed,
        "told": made.told,
        "known": batch.known,
        "sets": len(made.sets),
        "metrics": dict(outcome.metrics) if outcome else None,
        "elapsed": outcome.elapsed if outcome else None,
    }


def _sets(batch: Batch) -> list[dict[str, Any]]:
    scores = {score.id: score for score in batch.outcome.scores} if batch.outcome else {}
    rows = []
    for params, config in zip(batch.proposal.sets, batch.proposal.configs, strict=True):
        score = scores.get(params.id)
        found = (
            {
                "objectives": dict(score.objectives),
                "measures": dict(score.measures),
                "n_samples": score.n_samples,
                "error": score.error,
            }
            if score
            else {}
        )
        rows.append({"batch": batch.number, "config": config, "values": params.values, **found})
    return rows

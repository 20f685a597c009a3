"""Tools and prompts that introduce the server to an assistant."""

from __future__ import annotations

from typing import Any

from fastmcp import FastMCP

from robovast.base.plugins import plugins_of
from robovast.base.version import __version__
from robovast.evaluation.library import Library
from robovast.mcp.bounds import MOST_BYTES, page
from robovast.mcp.question import MOST_ROWS, TIME_LIMIT
from robovast.mcp.tools import add_tools

_TAXONOMY = {
    "names": "<verb>_<resource>[_<detail>]",
    "verbs": {
        "list": "existing items, in pages",
        "get": "one thing in full",
        "search": "items that meet conditions",
        "inspect": "statistics that are computed",
        "query": "SQL or SPARQL over all runs",
        "describe": "the server itself",
    },
    "resources": {
        "campaign": "an experiment: a .vast file and a scenario, run in several configurations",
        "configuration": "one set of parameters of a campaign",
        "run": "one execution of a configuration: verdict, reason, logs, files",
        "run_data": "the CSV files of runs, one by one or all as tables",
        "run_log": "a log of a run",
        "artifact": "a file that a campaign used or created",
        "provenance": "inputs, tools and activities behind each file",
        "search": "a campaign whose configurations a strategy proposes, batch by batch",
        "search_sets": "the parameter sets of a search with their scores",
        "plugin": "an installed extension",
    },
}
_GROUPS = (
    "robovast.variation_types",
    "robovast.postprocessing_commands",
    "robovast.publication_plugins",
    "robovast.share_providers",
    "robovast.cluster_configs",
    "robovast.metadata_processing",
    "robovast.failure_reasons",
    "robovast.search_strategies",
    "robovast.extractors",
    "robovast.mcp_plugins",
)


class OrientationTools:
    """Tools and prompts about the server itself."""

    name = "orientation"

    def __init__(self, library: Library) -> None:
        self._library = library

    def register(self, mcp: FastMCP) -> None:
        """Add tools and prompts to a server."""

        async def describe_server_capabilities() -> dict[str, Any]:
            """Describe the server: what it shows, its tools and prompts, its limits."""
            tools, prompts = await mcp.list_tools(), await mcp.list_prompts()
            return {
                "version": __version__,
                "results": str(self._library.results),
                "campaigns": len(self._library.names()),
                "tools": sorted(tool.name for tool in tools),
                "prompts": sorted(prompt.name for prompt in prompts),
                "limits": {
                    "answer_bytes": MOST_BYTES,
                    "query_rows": MOST_ROWS,
                    "query_seconds": TIME_LIMIT,
                },
            }

        mcp.tool(describe_server_capabilities, annotations={"readOnlyHint": True})
        add_tools(mcp, self.describe_tool_taxonomy, self.list_plugins)
        for prompt in (self.explain_failures, self.compare_campaigns, self.investigate_run):
            mcp.prompt(prompt)

    def describe_tool_taxonomy(self) -> dict[str, Any]:
        """Describe how tools are named: verbs and resources."""
        return _TAXONOMY

    def list_plugins(self, offset: int = 0) -> dict[str, Any]:
        """List the installed plugins: entry-point group, name and reference."""
        items = [
            {"group": group, "name": name, "reference": point.value}
            for group in _GROUPS
            for name, point in sorted(plugins_of(group).items())
        ]
        return page(items, offset, name="plugins")

    def explain_failures(self, campaign: str) -> str:
        """Find the causes of unsuccessful runs of a campaign."""
        return (
            f"Why did runs of the campaign `{campaign}` not pass? Begin with `inspect_campaign` "
            "for the reasons and for parameter values that fail more often than others. "
            "Take one run of each reason (`search_runs`), read its failure (`get_run`) and the "
            "errors in its log (`search_run_log`). For each reason, give the number of runs, the "
            "evidence (file and line), and the cause: robot, simulation or test. List open "
            "questions."
        )

    def compare_campaigns(self, before: str, after: str) -> str:
        """Find the changes between two campaigns."""
        return (
            f"What changed from the campaign `{before}` to `{after}`? Begin with "
            "`inspect_campaign_comparison`. Separate statistically certain changes from changes "
            "that chance can explain. Then look for the cause: compare `get_campaign` of both "
            "(image, versions), and for a configuration that got worse a run of each (`get_run`)."
        )

    def investigate_run(self, campaign: str, configuration: str, run: int) -> str:
        """Explain the verdict of one run."""
        return (
            f"What happened in run {run} of the configuration `{configuration}` of the campaign "
            f"`{campaign}`? Read `get_run`, then its log (`search_run_log`, errors first, then "
            "the lines before them) and its tables (`get_run_data`). Compare it with a run of "
            "the same configuration that passed, if there is one. End with the command that "
            "repeats the run."
        )

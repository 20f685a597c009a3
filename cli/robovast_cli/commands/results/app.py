"""`vast results`: download, process, analyze and share the results of campaigns."""

from collections.abc import Mapping

from robovast_cli.lazy import Lazy, new_group

_ANALYZE, _QUERY, _PROCESS, _SHARE = (
    "Analyze campaigns",
    "Query tables and graphs",
    "Process results",
    "Download and share results",
)
"""Headings in the help."""


COMMANDS: Mapping[str, Lazy] = {
    "summary": Lazy("summary", "Show failure rates, their causes and factors.", section=_ANALYZE),
    "compare": Lazy("compare", "Compare campaigns with a baseline.", section=_ANALYZE),
    "history": Lazy(
        "history", "Show the failure rate of a configuration in each campaign.", section=_ANALYZE
    ),
    "coverage": Lazy(
        "coverage", "Show failed pairs of values, and coverage gaps.", section=_ANALYZE
    ),
    "search": Lazy("search", "Show the results of a search.", section=_ANALYZE),
    "report": Lazy("report", "Write a report of a campaign as HTML or Markdown.", section=_ANALYZE),
    "junit": Lazy(
        "junit", "Merge the test results of all runs into one JUnit report.", section=_ANALYZE
    ),
    "query": Lazy("query", "Query the tables of campaigns with SQL.", section=_QUERY),
    "sparql": Lazy(
        "sparql", "Query the provenance graphs of campaigns with SPARQL.", section=_QUERY
    ),
    "postprocess": Lazy(
        "postprocess",
        "Convert raw results into tables, metadata and a provenance graph.",
        section=_PROCESS,
    ),
    "postprocess-commands": Lazy(
        "postprocess",
        "List the installed postprocessing commands and their parameters.",
        section=_PROCESS,
    ),
    "metadata": Lazy(
        "metadata",
        "Write metadata.yaml and the provenance graph of campaigns.",
        section=_PROCESS,
        aliases=("generate-metadata",),
    ),
    "merge-campaigns": Lazy("merge", "Merge campaigns into a new campaign.", section=_PROCESS),
    "download": Lazy(
        "download", "Download results from object storage or a file share.", section=_SHARE
    ),
    "import-results": Lazy("import_results", "Import a campaign from an archive.", section=_SHARE),
    "publish": Lazy(
        "publish", "Pack and publish results as configured in the .vast file.", section=_SHARE
    ),
    "publish-commands": Lazy(
        "publish", "List the installed publication plugins and their parameters.", section=_SHARE
    ),
    "list-share": Lazy("share", "List the campaigns on the file share.", section=_SHARE),
    "remove-from-share": Lazy("share", "Delete campaigns from the file share.", section=_SHARE),
}

app = new_group(
    "Download, process, analyze and share results.", "robovast_cli.commands.results", COMMANDS
)

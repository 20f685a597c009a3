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


def _lazy(target: str, help_text: str, section: str, aliases: tuple[str, ...] = ()) -> Lazy:
    return Lazy(f"robovast_cli.commands.results.{target}", help_text, aliases, section)


COMMANDS: Mapping[str, Lazy] = {
    "summary": _lazy("summary:app", "Show failure rates, their causes and factors.", _ANALYZE),
    "compare": _lazy("compare:app", "Compare campaigns with a baseline.", _ANALYZE),
    "history": _lazy(
        "history:app", "Show the failure rate of a configuration in each campaign.", _ANALYZE
    ),
    "coverage": _lazy("coverage:app", "Show failed pairs of values, and coverage gaps.", _ANALYZE),
    "search": _lazy("search:app", "Show the results of a search.", _ANALYZE),
    "report": _lazy("report:app", "Write a report of a campaign as HTML or Markdown.", _ANALYZE),
    "junit": _lazy(
        "junit:app", "Merge the test results of all runs into one JUnit report.", _ANALYZE
    ),
    "query": _lazy("query:app", "Query the tables of campaigns with SQL.", _QUERY),
    "sparql": _lazy("sparql:app", "Query the provenance graphs of campaigns with SPARQL.", _QUERY),
    "postprocess": _lazy(
        "postprocess:app",
        "Convert raw results into tables, metadata and a provenance graph.",
        _PROCESS,
    ),
    "postprocess-commands": _lazy(
        "postprocess:commands_app",
        "List the installed postprocessing commands and their parameters.",
        _PROCESS,
    ),
    "metadata": _lazy(
        "metadata:app",
        "Write metadata.yaml and the provenance graph of campaigns.",
        _PROCESS,
        aliases=("generate-metadata",),
    ),
    "merge-campaigns": _lazy("merge:app", "Merge campaigns into a new campaign.", _PROCESS),
    "download": _lazy(
        "download:app", "Download results from object storage or a file share.", _SHARE
    ),
    "import-results": _lazy("import_results:app", "Import a campaign from an archive.", _SHARE),
    "publish": _lazy(
        "publish:app", "Pack and publish results as configured in the .vast file.", _SHARE
    ),
    "publish-commands": _lazy(
        "publish:commands_app",
        "List the installed publication plugins and their parameters.",
        _SHARE,
    ),
    "list-share": _lazy("share:list_app", "List the campaigns on the file share.", _SHARE),
    "remove-from-share": _lazy("share:remove_app", "Delete campaigns from the file share.", _SHARE),
}

app = new_group("Download, process, analyze and share results.", COMMANDS)

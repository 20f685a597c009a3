"""`vast results`: from result folders to answers."""

from collections.abc import Mapping

from robovast_cli.lazy import Lazy, new_group

COMMANDS: Mapping[str, Lazy] = {
    "postprocess": Lazy(
        "robovast_cli.commands.results.postprocess:app",
        "Turn raw results into tables, metadata and a provenance graph.",
    ),
    "postprocess-commands": Lazy(
        "robovast_cli.commands.results.postprocess:commands_app",
        "List the installed postprocessing commands and their parameters.",
    ),
    "query": Lazy(
        "robovast_cli.commands.results.query:app", "Ask the tables of campaigns with SQL."
    ),
    "summary": Lazy(
        "robovast_cli.commands.results.summary:app",
        "Say how a campaign went: which configurations fail how often, and how sure that is.",
    ),
    "compare": Lazy(
        "robovast_cli.commands.results.compare:app",
        "Compare campaigns: what got worse, and whether chance explains it.",
    ),
    "history": Lazy(
        "robovast_cli.commands.results.history:app",
        "Say how often a configuration failed in each campaign, and what changed between.",
    ),
    "report": Lazy(
        "robovast_cli.commands.results.report:app",
        "Write a report of a campaign to send: one HTML file, or Markdown.",
    ),
    "coverage": Lazy(
        "robovast_cli.commands.results.coverage:app",
        "Say which pairs of values a campaign has run, which failed, and where holes are.",
    ),
    "junit": Lazy(
        "robovast_cli.commands.results.junit:app",
        "Merge the test results of all runs into one JUnit report.",
    ),
    "search": Lazy(
        "robovast_cli.commands.results.search:app",
        "Say what a search found: its sets, its progress, where it begins to fail.",
    ),
    "download": Lazy(
        "robovast_cli.commands.results.download:app",
        "Download results from the cluster's storage, or from the share.",
    ),
    "publish": Lazy(
        "robovast_cli.commands.results.publish:app",
        "Pack and publish results as configured in the .vast file.",
    ),
    "publish-commands": Lazy(
        "robovast_cli.commands.results.publish:commands_app",
        "List the installed publication plugins and their parameters.",
    ),
    "merge-campaigns": Lazy(
        "robovast_cli.commands.results.merge:app",
        "Merge campaigns: runs of equal configurations come together.",
    ),
    "list-share": Lazy(
        "robovast_cli.commands.results.share:list_app", "List the campaigns on the share."
    ),
    "remove-from-share": Lazy(
        "robovast_cli.commands.results.share:remove_app", "Remove campaigns from the share."
    ),
    "import-results": Lazy(
        "robovast_cli.commands.results.import_results:app",
        "Take over a campaign that comes as an archive.",
    ),
    "metadata": Lazy(
        "robovast_cli.commands.results.metadata:app",
        "Write metadata.yaml and the provenance graph of campaigns.",
        aliases=("generate-metadata",),
    ),
    "sparql": Lazy(
        "robovast_cli.commands.results.sparql:app",
        "Ask the provenance graphs of campaigns with SPARQL.",
    ),
}

app = new_group("Download, postprocess, query and publish results.", COMMANDS)

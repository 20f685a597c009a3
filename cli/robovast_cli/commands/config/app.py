"""`vast config`: list, generate and check configurations."""

from robovast_cli.lazy import Lazy, new_group

COMMANDS = {
    "list": Lazy("listing:list_", "List the configurations of the .vast file."),
    "gui": Lazy("listing", "List the configurations, as `vast config list`.", hidden=True),
    "generate": Lazy("generate", "Generate all inputs of a campaign without running them."),
    "view": Lazy("view", "Draw the map, start, goals, path and obstacles of configurations."),
    "info": Lazy("info", "Summarize the campaign that the .vast file describes."),
    "check": Lazy("info", "Check the .vast file, and warn about keys without effect."),
    "schema": Lazy("info", "Print the JSON Schema of .vast files, for editors."),
    "variation-types": Lazy("info", "List the installed variation types and their parameters."),
    "variation-points": Lazy("info", "List the scenario parameters that variations can set."),
    "export-configs": Lazy("entries", "Export configurations with fixed parameters."),
    "import-configs": Lazy("entries", "Add exported configurations to the .vast file."),
}

app = new_group(
    "List, generate and check configurations.", "robovast_cli.commands.config", COMMANDS
)

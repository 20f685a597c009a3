"""`vast evaluation`: the web UI, notebooks and the MCP server."""

from robovast_cli.lazy import Lazy, new_group

COMMANDS = {
    "gui": Lazy("robovast_cli.commands.evaluation.gui:app", "Start the web UI."),
    "mcp-server": Lazy("robovast_cli.commands.mcp:app", "Start an MCP server for AI assistants."),
    "index": Lazy(
        "robovast_cli.commands.evaluation.index:app", "Create the `campaign.db` of campaigns."
    ),
    "notebook": Lazy(
        "robovast_cli.commands.evaluation.notebook:app", "Open a notebook on results in Jupyter."
    ),
}

app = new_group("Browse results in the web UI and in notebooks.", COMMANDS)

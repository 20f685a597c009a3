"""`vast evaluation`: the web UI, notebooks and the MCP server."""

from robovast_cli.lazy import Lazy, new_group

COMMANDS = {
    "gui": Lazy("evaluation.gui", "Start the web UI."),
    "mcp-server": Lazy("mcp:mcp", "Start an MCP server for AI assistants."),
    "index": Lazy("evaluation.index", "Create the `campaign.db` of campaigns."),
    "notebook": Lazy("evaluation.notebook", "Open a notebook on results in Jupyter."),
}

app = new_group("Browse results in the web UI and in notebooks.", "robovast_cli.commands", COMMANDS)

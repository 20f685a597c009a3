"""`vast evaluation`: looking at results."""

from robovast_cli.lazy import Lazy, new_group

COMMANDS = {
    "gui": Lazy("robovast_cli.commands.evaluation.gui:app", "Look at results in the browser."),
    "mcp-server": Lazy(
        "robovast_cli.commands.mcp:app", "Let an assistant look at results, as `vast mcp`."
    ),
    "index": Lazy(
        "robovast_cli.commands.evaluation.index:app", "Make the campaigns' `campaign.db`."
    ),
    "notebook": Lazy(
        "robovast_cli.commands.evaluation.notebook:app", "Open a notebook on results in Jupyter."
    ),
}

app = new_group("Look at results.", COMMANDS)

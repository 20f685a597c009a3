"""`vast mcp`: results as tools for assistants."""

import os
import secrets
from collections.abc import Mapping
from typing import Annotated, Literal

import typer

from robovast.base.errors import InputError
from robovast.base.optional_deps import MCP
from robovast_cli.commands.results.options import ResultsDir
from robovast_cli.lazy import new_app
from robovast_cli.ui.output import say

TOKEN = "ROBOVAST_MCP_TOKEN"  # noqa: S105  # the variable's name

app = new_app("Let an assistant look at results (MCP).")


@app.command()
def mcp(
    ctx: typer.Context,
    results_dir: ResultsDir = None,
    transport: Annotated[
        Literal["stdio", "streamable-http", "sse"],
        typer.Option(
            "--transport",
            help="How clients talk to it: `stdio` when they start it, else HTTP (`sse`: old ones).",
        ),
    ] = "stdio",
    host: Annotated[
        str, typer.Option("--host", metavar="HOST", help="Loopback address, for HTTP.")
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option("-p", "--port", min=0, max=65535, help="Port, for HTTP; 0 for any free.")
    ] = 8000,
    debug: Annotated[bool, typer.Option("--debug", help="Log all messages to stderr.")] = False,
) -> None:
    """Let an assistant look at results, over the Model Context Protocol.

    The tools only read, and only below the results folder. Over HTTP, each request must carry a
    token (`Authorization: Bearer …`): that of the environment variable ROBOVAST_MCP_TOKEN, else a
    new one, which is printed.

    Example: claude mcp add robovast -- vast mcp -r results
    """
    from robovast.model.naming import holds_campaign

    with MCP.needed_by("The MCP server"):
        from robovast.mcp.serving import serve_http, serve_stdio
    folder = (results_dir or ctx.obj.results).resolve()
    root = folder.parent if holds_campaign(folder) else folder
    if transport == "stdio":
        serve_stdio(root, debug)
        return
    token, told = choose_token(os.environ)

    def show(url: str) -> None:
        say(f"Serving {root} at {url} with {told}")

    serve_http(root, (host, port), token, show, transport, debug)


def choose_token(environment: Mapping[str, str]) -> tuple[str, str]:
    """The token of HTTP requests, and how the user is told of it: one that is given stays unsaid.

    Raises:
        InputError: the one given is empty.
    """
    given = environment.get(TOKEN)
    if given is None:
        token = secrets.token_urlsafe(24)
        return token, f"this token: {token}"
    if not given.strip():
        raise InputError(f"{TOKEN} is empty: give it a secret, or unset it for a new one.")
    return given, f"the token of {TOKEN}"

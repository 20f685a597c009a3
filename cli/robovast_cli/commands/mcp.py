"""`vast mcp`: results as tools for AI assistants."""

import os
import secrets
from collections.abc import Mapping
from typing import Annotated, Literal

import typer

from robovast.base.errors import InputError
from robovast.base.optional_deps import MCP
from robovast_cli.commands.results.options import ResultsDir
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo

TOKEN = "ROBOVAST_MCP_TOKEN"  # noqa: S105  # the variable's name


@examples(
    ("claude mcp add robovast -- vast mcp -r results", "Register the server in Claude Code"),
    ("vast mcp -r results", "Serve over stdio"),
    ("vast mcp --transport streamable-http -p 0", "Serve over HTTP at a free port"),
)
def mcp(
    ctx: typer.Context,
    results_dir: ResultsDir = None,
    transport: Annotated[
        Literal["stdio", "streamable-http", "sse"],
        typer.Option(
            "--transport",
            help="Transport: `stdio` if the client starts the server, else HTTP (`sse` for old "
            "clients).",
        ),
    ] = "stdio",
    host: Annotated[
        str, typer.Option("--host", metavar="HOST", help="Loopback address for HTTP.")
    ] = "127.0.0.1",
    port: Annotated[
        int,
        typer.Option(
            "-p", "--port", min=0, max=65535, help="Port for HTTP; 0 selects a free port."
        ),
    ] = 8000,
    debug: Annotated[bool, typer.Option("--debug", help="Log all messages to stderr.")] = False,
) -> None:
    """Start an MCP server for AI assistants.

    The tools can only read files in the results folder. Over HTTP, each request needs a token
    (`Authorization: Bearer …`): the value of ROBOVAST_MCP_TOKEN, else a new token, which is
    printed.
    """
    from robovast.model.naming import holds_campaign

    with MCP.needed_by("The MCP server"):
        from robovast.mcp.serving import serve_http, serve_stdio
    folder = (results_dir or ctx.obj.results).resolve()
    root = folder.parent if holds_campaign(folder) else folder
    if transport == "stdio":
        serve_stdio(root, debug)
        return
    token, description = choose_token(os.environ)

    def show(url: str) -> None:
        echo(f"Serving {root} at {url} with {description}")

    serve_http(root, (host, port), token, show, transport, debug)


def choose_token(environment: Mapping[str, str]) -> tuple[str, str]:
    """Return the token of HTTP requests and its description, which hides a token of the user.

    Raises:
        InputError: the variable is empty.
    """
    chosen = environment.get(TOKEN)
    if chosen is None:
        token = secrets.token_urlsafe(24)
        return token, f"this token: {token}"
    if not chosen.strip():
        raise InputError(
            f"{TOKEN} is empty", hint="set it to a secret, or unset it for a new token"
        )
    return chosen, f"the token of {TOKEN}"

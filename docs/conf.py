"""Settings of the documentation site; `scripts/docs` builds it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from robovast import __version__

_ROOT = Path(__file__).parents[1]

project = "RoboVAST"
author = "The RoboVAST developers"
copyright = author  # noqa: A001
release = __version__
version = release

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_reredirects",
    "sphinxcontrib.mermaid",
]
html_theme = "furo"
html_title = f"RoboVAST {release}"
html_theme_options = {"navigation_with_keys": True}

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 4
myst_fence_as_directive = ["mermaid"]
suppress_warnings = ["misc.highlighting_failure"]  # .vast files quote other languages

copybutton_exclude = ".linenos, .gp, .go"

autodoc_typehints = "description"
autodoc_member_order = "bysource"

# Diagrams load this folder instead of a server in the internet; `scripts/docs` fills it.
_mermaid = os.environ.get("ROBOVAST_MERMAID")
html_static_path = [_mermaid] if _mermaid else []
mermaid_use_local = "mermaid.esm.min.mjs" if _mermaid else ""


def _link_included_pages(_app: object, _page: str, text: list[str]) -> None:
    """Replace links to files outside this folder by links to the pages that include the files."""
    text[0] = text[0].replace("(../../SECURITY.md", "(../reference/security-policy.md")


def setup(app: Any) -> None:
    """Connect the functions above with Sphinx."""
    app.connect("source-read", _link_included_pages)


# Old pages, and the pages with their content.
redirects = {
    "agent": "contributing/agent.html",
    "api": "reference/api-policy.html",
    "architecture": "explanation/architecture.html",
    "argocd": "how-to/argocd.html",
    "benchmarks": "explanation/benchmarks.html",
    "cli": "reference/cli/index.html",
    "cluster-admin": "how-to/install-on-kubernetes.html",
    "cluster-cli": "how-to/cluster.html",
    "cluster-requirements": "reference/cluster-requirements.html",
    "coming-from": "how-to/migrate.html",
    "confidence": "how-to/failure-rates.html",
    "evaluation": "how-to/web-ui.html",
    "first-robot": "tutorials/first-robot.html",
    "kubernetes": "how-to/kubectl.html",
    "mcp": "how-to/mcp.html",
    "navigation": "reference/navigation.html",
    "other-tools": "how-to/other-tools.html",
    "postprocessing": "reference/postprocessing.html",
    "provenance": "reference/provenance.html",
    "publication": "how-to/publish.html",
    "results": "reference/results.html",
    "ros-bags": "reference/ros-bags.html",
    "run-contract": "reference/container-interface.html",
    "scripting": "how-to/scripting.html",
    "variations": "how-to/write-plugins.html",
    "vast-file": "reference/vast-file.html",
}

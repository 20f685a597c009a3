"""Describing campaigns in front of a user."""

from __future__ import annotations

import logging
from pathlib import Path

from robovast.analysis.provenance import describe
from robovast.analysis.provenance.drawing import write_drawing
from robovast.base.errors import ExitCode, RobovastError
from robovast.campaign.finding import find_campaigns
from robovast_cli.ui.output import say
from robovast_cli.ui.working import working
from robovast_cli.workspace import shown

_log = logging.getLogger(__name__)


def describe_campaigns(results: Path, *, own_plugins: bool, draw: bool) -> ExitCode:
    """Write metadata and graph of every campaign in a folder; a fault in one stops no other.

    Args:
        results: the folder.
        own_plugins: whether plugins in the campaigns' own files are executed.
        draw: whether the graph is drawn, too.
    """
    code = ExitCode.OK
    for campaign in find_campaigns(results):
        try:
            with working(f"Describing {shown(campaign)}"):
                describe(campaign, own_plugins=own_plugins)
                if draw:
                    write_drawing(campaign)
        except RobovastError as error:
            _log.error("%s", error)
            code = error.exit_code
        else:
            drawn = ", metadata.dot, metadata.pdf" if draw else ""
            say(f"{shown(campaign)}: metadata.yaml, metadata.prov.json{drawn}")
    return code

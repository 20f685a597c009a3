"""The shell scripts that run in the containers of a run."""

from __future__ import annotations

from pathlib import Path

FOLDER = ".robovast"
"""Of what the agent and these scripts share, among a run's inputs, whose names are the user's."""

START = Path(__file__).with_name("start.sh")
"""Runs the jobs that the agent orders."""

AWAIT = Path(__file__).with_name("await.sh")
"""Waits until the agent has prepared the run; the operator puts its text into the pod."""

SHELL = ("bash", "-p")
"""Of both, without the image's functions, options and BASH_ENV, which are for the run."""

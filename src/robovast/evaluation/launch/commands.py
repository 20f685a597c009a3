"""Words of `vast` commands; what a request holds stays inside of a word, whatever it is."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError
from robovast.evaluation.inside import resolved
from robovast.model.naming import CONFIG

RUNTIMES = ("auto", "docker", "podman", "process")
LONGEST = 500
"""Characters of a pattern."""

_COUNT = re.compile(r"[1-9][0-9]{0,5}")


@dataclass(frozen=True)
class Choices:
    """What a user chooses for a campaign; the defaults leave it to the document and to `vast`."""

    config: str = ""
    """Name or glob of the configurations."""
    runs: int | None = None
    """Runs of each configuration."""
    jobs: int | None = None
    """Jobs side by side."""
    runtime: str = "auto"
    """One of `RUNTIMES`."""


def read_choices(asked: Mapping[str, str]) -> Choices:
    """Choices from a request.

    Raises:
        InputError: one of them is none that there is.
    """
    config, runtime = asked.get("config", ""), asked.get("runtime") or "auto"
    if len(config) > LONGEST or not config.isprintable():
        raise InputError(f"A pattern has at most {LONGEST} characters, in one line.")
    if runtime not in RUNTIMES:
        raise InputError(f"{runtime!r} is no runtime; there are {', '.join(RUNTIMES)}.")
    return Choices(config, _count(asked, "runs"), _count(asked, "jobs"), runtime)


def _count(asked: Mapping[str, str], key: str) -> int | None:
    text = asked.get(key, "")
    if text and not _COUNT.fullmatch(text):
        raise InputError(f"`{key}` is a number from 1 to 999999, not {text!r}.")
    return int(text) if text else None


def run_words(document: Path, results: Path, choices: Choices) -> list[str]:
    """The command that runs a campaign of a document into a results folder."""
    chosen = {
        "config": choices.config,
        "runs": choices.runs,
        "jobs": choices.jobs,
        "runtime": choices.runtime if choices.runtime != "auto" else None,
    }
    options = [f"--{name}={value}" for name, value in chosen.items() if value]
    return [f"--vast-file={document}", "exec", "local", "run", f"--output={results}", *options]


def expansion_words(document: Path) -> list[str]:
    """The command that says what a document expands to, as JSON."""
    return [f"--vast-file={document}", "config", "list", "--output=json", "--debug"]


def postprocessing_words(results: Path, override: Path | None) -> list[str]:
    """The command that brings the tables of a results folder up to date."""
    options = [f"--override={override}"] if override else []
    return ["results", "postprocess", f"--results-dir={results}", *options]


def repeat_words(
    results: Path, campaign: str, variant: str, record: Mapping[str, Any]
) -> list[str]:
    """The command that executes a variant once more, with the image that the run had.

    Empty when the campaign holds no .vast file.
    """
    try:
        documents = sorted(resolved(results, f"{campaign}/{CONFIG}").glob("*.vast"))
    except InputError:
        return []
    if not documents:
        return []
    words = ["-V", str(documents[0]), "exec", "local", "run", f"--config={variant}", "--runs=1"]
    image = str(record.get("image") or "")
    if record.get("runtime") == "process":
        words.append("--runtime=process")
    elif image:
        words.append(f"--image={image}")
    return words


def as_shell(words: Sequence[str]) -> str:
    """A command as one types it; empty for no words."""
    return shlex.join(["vast", *words]) if words else ""

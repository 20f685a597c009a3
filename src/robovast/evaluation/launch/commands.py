"""Builds argument lists of `vast` commands; no part of a request can add arguments."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError
from robovast.campaign.layout import Layout
from robovast.campaign.verdict import Verdict
from robovast.evaluation.confined_files import resolved
from robovast.evaluation.summaries import CampaignSummary
from robovast.model.packs import RUNS_LIMIT

RUNTIMES = ("auto", "docker", "podman", "process")
LONGEST = 500
"""Longest pattern [characters]."""

_OF_ANOTHER = frozenset({"replay_of", "minimise_of"})
"""Keys of the execution of a campaign whose own command continues it."""
_COUNT = re.compile(rf"[1-9][0-9]{{0,{len(str(RUNS_LIMIT)) - 1}}}")


@dataclass(frozen=True)
class Choices:
    """A user's choices for a campaign; None leaves a choice to the document and to `vast`."""

    config: str = ""
    """Name or glob of the configurations."""
    runs: int | None = None
    """Runs of each configuration."""
    jobs: int | None = None
    """Number of parallel jobs."""
    runtime: str = "auto"
    """One of `RUNTIMES`."""


def read_choices(asked: Mapping[str, str]) -> Choices:
    """Read choices from a request.

    Raises:
        InputError: a choice is invalid.
    """
    config, runtime = asked.get("config", ""), asked.get("runtime") or "auto"
    if len(config) > LONGEST or not config.isprintable():
        raise InputError(f"A pattern has at most {LONGEST} characters, in one line.")
    if runtime not in RUNTIMES:
        raise InputError(
            f"{runtime!r} is not a valid runtime", hint=f"use one of {', '.join(RUNTIMES)}"
        )
    return Choices(config, _count(asked, "runs"), _count(asked, "jobs"), runtime)


def _count(asked: Mapping[str, str], key: str) -> int | None:
    text = asked.get(key, "")
    if not text:
        return None
    if not _COUNT.fullmatch(text) or int(text) > RUNS_LIMIT:
        raise InputError(f"`{key}` is a number from 1 to {RUNS_LIMIT}, not {text!r}.")
    return int(text)


def run_words(document: Path, results: Path, choices: Choices) -> list[str]:
    """Arguments that run a document's campaign into a results folder."""
    chosen = {
        "config": choices.config,
        "runs": choices.runs,
        "jobs": choices.jobs,
        "runtime": choices.runtime if choices.runtime != "auto" else None,
    }
    options = [f"--{name}={value}" for name, value in chosen.items() if value]
    return [f"--vast-file={document}", "exec", "local", "run", f"--output={results}", *options]


def expansion_words(document: Path) -> list[str]:
    """Arguments that print a document's expansion as JSON."""
    return [f"--vast-file={document}", "config", "list", "--output=json", "--debug"]


def postprocessing_words(results: Path, override: Path | None) -> list[str]:
    """Arguments that update the tables of a results folder."""
    options = [f"--override={override}"] if override else []
    return ["results", "postprocess", f"--results-dir={results}", *options]


def repeat_words(results: Path, place: str, record: Mapping[str, Any]) -> list[str]:
    """Arguments that reproduce a run: with its seed, files and image, and a comparison with it.

    Empty if the run has no result, or its campaign no .vast file.

    Args:
        results: the results folder; the replay is stored there, too.
        place: the run's folder in it, `<campaign>/<variant>/<run>`.
        record: of the run.
    """
    try:
        layout = Layout(resolved(results, place.partition("/")[0]))
    except InputError:
        return []
    if not layout.documents or record.get("verdict") in (None, Verdict.INTERRUPTED):
        return []
    return ["replay", str(results / place), f"--out={results}"]


def resume_words(results: Path, summary: CampaignSummary) -> list[str]:
    """Arguments that execute what is missing of a campaign; empty if it is no one of this machine,
    or nothing is missing."""
    return continue_words(results, summary) if summary.state == "incomplete" else []


def continue_words(results: Path, summary: CampaignSummary) -> list[str]:
    """Arguments that continue a campaign; empty if it is no one of this machine, or was made by a
    command that does so itself."""
    execution = summary.execution
    if execution.get("execution_type") != "local" or _OF_ANOTHER & execution.keys():
        return []
    return ["exec", "local", "run", f"--resume={results / summary.name}"]


def more_runs_command(results: Path, summary: CampaignSummary) -> list[str]:
    """Arguments that configurations and runs are added to, to give a campaign more of them; empty
    for a search, which has batches, and where `continue_words` are."""
    return [] if summary.is_search else continue_words(results, summary)


def more_runs_words(
    results: Path, summary: CampaignSummary, configurations: Sequence[str], runs: int
) -> list[str]:
    """Arguments that execute configurations of a campaign so often in all."""
    words = more_runs_command(results, summary)
    chosen = [f"--config={name}" for name in configurations]
    return [*words, *chosen, f"--runs={runs}"] if words else []


def more_batches(results: Path, summary: CampaignSummary) -> tuple[str, str] | None:
    """What stands before and behind a number of batches in the command that lets a search end only
    then; None if there is no such command. The results do not say what a Campaign is called."""
    if words := continue_words(results, summary):
        return f"{as_shell(words)} --batches ", ""
    if summary.execution.get("execution_type") == "cluster":
        patch = '{"spec": {"vast": {"search": {"budget": [{"batches": '
        return (
            f"kubectl patch campaign NAME --type merge -p '{patch}",
            '}], "stopping": null}}}}\'',
        )
    return None


def as_shell(words: Sequence[str]) -> str:
    """A command in shell syntax; empty without arguments."""
    return shlex.join(["vast", *words]) if words else ""

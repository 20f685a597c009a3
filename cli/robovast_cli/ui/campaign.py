"""Run a campaign with a view of its progress and a summary at the end."""

from __future__ import annotations

import os
import re
import shlex
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from robovast.base.errors import ExitCode, InputError, with_hint
from robovast.campaign.decisions import runs_needed
from robovast.campaign.failure_groups import FailureGroup, failure_groups
from robovast.campaign.layout import SYSTEM_LOG, Layout
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.execution.local import ExecutionSummary, LocalOptions
from robovast.execution.local.process_environment import VARIABLE
from robovast.model.document import Document
from robovast.model.expansion import select_variants
from robovast.search import local as search
from robovast.search.local import SearchSummary, execute_document
from robovast_cli.ui.expansion import expanded_variants
from robovast_cli.ui.live_view import LiveView, is_live
from robovast_cli.ui.local_view import LocalView
from robovast_cli.ui.output import ask, echo_verdicts
from robovast_cli.ui.search_summary import search_lines
from robovast_cli.ui.table import counted
from robovast_cli.workspace import shown

MOST_LISTED = 20
"""Maximum number of causes in the summary."""
_NO_MODULE = "No module named"
_NAME_ANOTHER = (
    f"In each terminal, set {VARIABLE} to an environment with this module, "
    f"for example for ROS: export {VARIABLE}=$(scripts/ros-environment)"
)


def start(document: Document, output: Path, options: LocalOptions) -> ExitCode:
    """Run a new campaign."""
    return _watch(lambda view: execute_document(document, output, options, view))


def reject_vast_file(out: Path | None) -> None:
    """Reject a .vast file in place of the results folder.

    Raises:
        InputError: the name ends with `.vast`, and it is not a folder.
    """
    if out is None or out.suffix != ".vast" or out.is_dir():
        return
    if os.path.exists(out):
        raise InputError(
            f"`{out}` is a .vast file, but OUT is the results folder",
            hint=f"run the file with `vast --vast-file {out} exec local run`",
        )
    raise InputError(
        f"`{out}` does not exist",
        hint="pass a .vast file with `--vast-file`. OUT is the results folder, whose name must "
        "not end with `.vast`",
    )


def resolve_selection(document: Document, out: Path, options: LocalOptions) -> LocalOptions:
    """Return the options, with the selection in OUT if the user confirms that OUT is a selection.

    Raises:
        InputError: OUT is a selection but there is no terminal to ask the user, or OUT looks like
            the name of a configuration that does not exist.
    """
    entries = [entry.name for entry in document.vast.configuration or ()]
    if os.path.lexists(out) or not _looks_like_configuration(str(out), entries):
        return options
    folder = f"use `--output '{out}'` to create a folder of this name"
    with expanded_variants(document) as variants:
        try:
            number = len(select_variants(variants, str(out)))
        except InputError as error:
            hint = with_hint(error.hint, f"OUT is the results folder; {folder}")
            raise InputError(error.message, hint=hint) from None
    kind = "a configuration" if number == 1 else f"the name of {number} configurations"
    if not sys.stdin.isatty():
        raise InputError(
            f"`{out}` is {kind}, but OUT is the results folder",
            hint=f"use `--config '{out}'` to run only this selection; {folder}",
        )
    question = f"`{out}` is {kind}. Run only this selection (no: create the folder {out})?"
    return replace(options, select=str(out)) if ask(question, default=True) else options


def _looks_like_configuration(name: str, entries: Iterable[str]) -> bool:
    """Return whether a name is a pattern, or an entry with or without numbers."""
    if "/" in name:
        return False
    return bool(re.search(r"[*?[]", name)) or any(
        re.fullmatch(rf"{re.escape(entry)}(-\d*)*", name) for entry in entries
    )


def resume(campaign: Path, options: LocalOptions) -> ExitCode:
    """Run the remaining runs of a campaign."""
    return _watch(lambda view: search.resume(campaign, options, view))


def _watch(execute: Callable[[LocalView], ExecutionSummary]) -> ExitCode:
    with view() as progress:
        summary = execute(progress)
    for line in summary_lines(summary):
        echo_verdicts(line)
    return exit_code(summary)


def view() -> LocalView:
    """Return a live view on a terminal, lines elsewhere."""
    return LocalView(partial(LiveView, transient=True) if is_live(sys.stdout) else None)


def exit_code(summary: ExecutionSummary) -> ExitCode:
    """Return the exit code for a campaign."""
    verdicts = {record.verdict for record in summary.records}
    if summary.interrupted:
        return ExitCode.INTERRUPTED
    if isinstance(summary, SearchSummary):
        gave_up = summary.stop is not None and summary.stop.kind == "errors"
        return ExitCode.RUN_ERRORED if gave_up or not summary.scored else ExitCode.OK
    if Verdict.FAILED in verdicts:
        return ExitCode.TEST_FAILED
    if verdicts - {Verdict.PASSED} or summary.missing:
        return ExitCode.RUN_ERRORED
    return ExitCode.OK


def summary_lines(summary: ExecutionSummary) -> Iterator[str]:
    """Yield the result of a campaign: causes of failures, counts and results folder."""
    yield ""
    if isinstance(summary, SearchSummary):
        yield from search_lines(summary)
    else:
        yield from _causes(summary)
    if summary.decided:
        yield f"{_decisions(summary)}."
    yield f"{_counts(summary)}."
    yield f"Results: {shown(summary.campaign)}"
    if summary.missing or summary.interrupted:
        folder = shlex.quote(str(shown(summary.campaign)))
        yield f"Continue: vast exec local run --resume {folder}"


def _causes(summary: ExecutionSummary) -> Iterator[str]:
    groups = failure_groups((record, record.verdict, record.reason) for record in summary.records)
    listed = _listed(groups)
    for group in listed:
        yield _cause_line(summary, group)
    if rest := [group for group in groups if group not in listed]:
        verdicts = _verdicts(record for group in rest for record in group.runs)
        yield f"… and {len(rest)} more causes: {', '.join(verdicts)}."
    yield from [""] if groups else []
    yield from _missing_module(summary)


def _missing_module(summary: ExecutionSummary) -> Iterator[str]:
    """Yield the remedy if a local process lacks a Python module."""
    for record in summary.records:
        if record.runtime == "process" and _NO_MODULE in record.reason:
            yield f"Local processes have only the modules of {record.image}. {_NAME_ANOTHER}"
            yield ""
            return


def _listed(groups: Sequence[FailureGroup[RunRecord]]) -> list[FailureGroup[RunRecord]]:
    """Return the listed groups: crashes and timeouts take precedence over failures."""
    chosen = sorted(groups, key=lambda group: group.verdicts == (Verdict.FAILED,))[:MOST_LISTED]
    return [group for group in groups if group in chosen]


def _cause_line(summary: ExecutionSummary, group: FailureGroup[RunRecord]) -> str:
    first, count = group.runs[0], len(group.runs)
    log = shown(Layout(summary.campaign).job(first.job) / SYSTEM_LOG)
    verdicts = "/".join(group.verdicts)
    more = " …" if count > 1 else ""
    return f"{verdicts:<8}{count:>4} × {group.text}  {first.variant}/{first.run}{more} ({log})"


def _counts(summary: ExecutionSummary) -> str:
    parts = _verdicts(summary.records)
    spared = sum(one.spared for one in summary.decided)
    parts += [f"{spared} not needed"] if spared else []
    parts += [f"{summary.missing} not started"] if summary.missing else []
    reused = sum(bool(record.reused_from) for record in summary.records)
    note = f"; reused {reused} of {summary.total}" if reused else ""
    return f"{counted(summary.total, 'run')}: {', '.join(parts) or 'none'}{note}"


def _decisions(summary: ExecutionSummary) -> str:
    decisions = [one.decision for one in summary.decided]
    needed = sum(decision.runs for decision in decisions)
    further = len(summary.records) - needed
    more = f" ({further} more are stored)" if further > 0 else ""
    return f"{runs_needed(decisions, summary.total)}{more}"


def _verdicts(records: Iterable[RunRecord]) -> list[str]:
    counts = Counter(record.verdict for record in records)
    return [f"{counts[verdict]} {verdict}" for verdict in Verdict if counts[verdict]]

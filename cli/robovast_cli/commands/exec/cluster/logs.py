"""`vast exec cluster logs`: print the log of a pending, running or stored run."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import Annotated

import typer

from robovast.base.errors import InputError
from robovast.base.file_errors import LARGEST
from robovast.base.safe_paths import read_end
from robovast.campaign.job_log import has_parts, log_path, part_of
from robovast.campaign.run_record import RunRecord
from robovast.kubeapi.pod_contract.pack_request import RUN
from robovast_cli.kube.api import KubernetesClient, connect
from robovast_cli.kube.api_errors import NotFoundError
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.kube.pods import check_container, has_started, is_prepared, waiting_reason
from robovast_cli.kube.results import named_results
from robovast_cli.kube.runs import CampaignRuns, Executor
from robovast_cli.kube.status import CampaignState, campaign_states, list_names, lookup
from robovast_cli.kube.store import place_of
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo_data
from robovast_cli.ui.report import echo_stderr

INTERVAL = 2.0
"""Time between two requests for a pending run [s]."""


@dataclass(frozen=True)
class LogOptions:
    """Which lines of a log are printed."""

    follow: bool = False
    secondary: str | None = None
    """Name of a secondary container; None for the main one."""
    tail: int | None = None
    """Maximum number of lines; None for all."""

    def last(self, lines: Iterable[str]) -> Sequence[str]:
        """Return the lines to print."""
        return deque(lines, self.tail)


RunNames = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[CAMPAIGN] RUN",
        help="Run, for example `hall-1/0`. Add CAMPAIGN if the namespace has several campaigns.",
    ),
]
Secondary = Annotated[
    str | None,
    typer.Option(
        "--secondary", metavar="NAME", help="Secondary container (default: the main container)."
    ),
]


@examples(
    ("vast exec cluster logs hall-1/0 --follow", "Stream the log of a run"),
    ("vast exec cluster logs hall-x7k2p hall-1/0 --tail 50", "Name the campaign, print 50 lines"),
    ("vast exec cluster logs --failed", "Print the logs of all unsuccessful runs"),
)
def logs(
    names: RunNames = None,
    follow: Annotated[
        bool, typer.Option("--follow", help="Wait for the run to start and stream its log.")
    ] = False,
    secondary: Secondary = None,
    tail: Annotated[
        int | None, typer.Option("--tail", metavar="N", min=0, help="Print only the last N lines.")
    ] = None,
    failed: Annotated[
        bool, typer.Option("--failed", help="Print the logs of all failed and errored runs.")
    ] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Print the log of a running or stored run.

    If the run is pending, prints the reason for waiting. If several runs share a pod, prints only
    the part of this run.
    """
    options = LogOptions(follow, secondary, tail)
    if failed:
        if follow or len(names or []) > 1:
            raise InputError(
                "`--failed` accepts at most a campaign, and cannot be combined with `--follow`.",
                hint="remove the run or `--follow`",
            )
        with open_runs(context, namespace, next(iter(names or []), None)) as (kube, runs):
            for run in runs.bad():
                RunLog(kube, runs, run, options).print_titled()
        return
    campaign, run = parse_names(names)
    with open_runs(context, namespace, campaign) as (kube, runs):
        RunLog(kube, runs, run, options).print()


def parse_names(names: Sequence[str] | None) -> tuple[str | None, str]:
    """Return the campaign, if it is named, and the run.

    Raises:
        InputError: no run is named.
    """
    if names is None or len(names) > 2:
        raise InputError(
            "no run is named",
            hint="name a run, for example `hall-1/0`. If the namespace has several campaigns, "
            "name the campaign before the run",
        )
    return (names[0] if len(names) == 2 else None), names[-1]


@contextmanager
def open_runs(
    context: str | None, namespace: str | None, name: str | None
) -> Iterator[tuple[KubernetesClient, CampaignRuns]]:
    """Yield the runs of a campaign (default: the only one, else the only unfinished one).

    Raises:
        InputError: there is no such campaign.
    """
    with connect(context, namespace) as kube, ExitStack() as stack:
        known = campaign_states(kube)
        campaign = _only(kube, known) if name is None else lookup(known, name)
        if campaign is None and name is not None:
            results = named_results(kube, known, name)
            yield kube, CampaignRuns(kube, None, results.bucket, results.place, stack)
        elif campaign is not None:
            place = place_of(campaign)
            yield kube, CampaignRuns(kube, campaign, campaign.bucket, place, stack)


def _only(kube: KubernetesClient, known: Sequence[CampaignState]) -> CampaignState:
    unfinished = [campaign for campaign in known if not campaign.finished]
    for found in (known, unfinished):
        if len(found) == 1:
            return found[0]
    names = list_names(known)
    raise InputError(
        f"no campaign is named: the namespace {kube.namespace} has {names}",
        hint="name a campaign before the run",
    )


class RunLog:
    """Prints the log of one run."""

    def __init__(
        self, kube: KubernetesClient, runs: CampaignRuns, run: str, options: LogOptions
    ) -> None:
        self._kube = kube
        self._runs = runs
        self._run = run
        self._options = options

    def print(self) -> None:
        """Print the log, or why it does not exist yet; with `follow`, wait until it exists."""
        printed = ""
        while True:
            executor = self._runs.executor(self._run)
            if executor is not None and self._print_live(executor):
                return
            record = self._runs.record(self._run)
            if record is not None:
                self._print_stored(record)
                return
            reason = self._waiting(executor)
            if reason != printed:
                echo_stderr(f"{self._run} is pending: {reason.rstrip('.')}.")
                printed = reason
            if not self._options.follow:
                return
            time.sleep(INTERVAL)

    def print_titled(self) -> None:
        """Print the log below a line with the verdict and the reason."""
        record = self._runs.record(self._run)
        if record is None:
            _echo_lines([f"==> {self._run}: errored: never stored <=="])
            return
        _echo_lines([f"==> {self._run}: {record.verdict}: {record.reason} <=="])
        self._print_stored(record)
        _echo_lines([""])

    def _print_live(self, executor: Executor) -> bool:
        """Print the log in a pod, with `follow` also new lines; return False without a log."""
        container = self._options.secondary or RUN
        check_container(executor.pod, container)
        if not has_started(executor.pod, container):
            return False
        try:
            lines = list(self._kube.log(executor.name, container))
        except NotFoundError:  # the pod was deleted in the meantime
            return False
        if not lines and not is_prepared(executor.pod):
            return False
        shared = executor.runs > 1 and container == RUN
        parts = has_parts(lines) if shared else False
        part = list(part_of(lines, self._run)) if parts else []
        elsewhere = parts and not part
        if parts is None or elsewhere or (shared and not parts and self._is_stored(executor)):
            return False
        shown = part or self._whole(lines, executor.runs)
        _echo_lines(self._options.last(shown))
        if self._options.follow:
            live = self._kube.log(executor.name, container, follow=True)
            new = part_of(live, self._run) if parts else live
            _echo_lines(islice(new, len(shown), None))
        return True

    def _is_stored(self, executor: Executor) -> bool:
        """Return whether an earlier pod has stored a run that is not in the log of a pod."""
        record = self._runs.record(self._run)
        return record is not None and record.attempt >= executor.attempt

    def _print_stored(self, record: RunRecord) -> None:
        path = log_path(self._options.secondary)
        with self._runs.stored_log(record.job, path) as file:
            text = read_end(file, file.parent, LARGEST)[0].decode("utf-8", "replace")
        lines = text.removesuffix("\n").split("\n")
        part = list(part_of(lines, self._run))
        runs = 1 if part else self._runs.runs_of_job(record.job)
        _echo_lines(self._options.last(part or self._whole(lines, runs)))

    def _whole(self, lines: Sequence[str], runs: int) -> Sequence[str]:
        """Return the lines of the log of a job; print a note if it has several runs."""
        if runs > 1:
            echo_stderr(
                f"{self._run}: the log is from a job with {runs} runs and cannot be divided."
            )
        return lines

    def _waiting(self, executor: Executor | None) -> str:
        """Return why a run is neither running nor stored."""
        campaign = self._runs.campaign
        if executor is not None and is_prepared(executor.pod) and has_started(executor.pod, RUN):
            return f"its pod {executor.name} has not started this run yet"
        if executor is not None:
            return waiting_reason(executor.pod)
        self._runs.check_accepted()
        if campaign is None or (campaign.finished and not campaign.rejected):
            raise InputError(
                f"`{self._run}` is not among the stored runs of the campaign.",
                hint="name a run as `<configuration>/<number>`, for example `hall-1/0`",
            )
        if campaign.suspended:
            return (
                f"the campaign is stopped; resume it: vast exec cluster resume -i {campaign.name}"
            )
        if campaign.messages:
            return "; ".join(campaign.messages)
        if self._runs.planned is None:
            return "the campaign has no plan yet"
        return f"the run has no pod yet ({campaign.counts()})"


def _echo_lines(lines: Iterable[str]) -> None:
    for line in lines:
        echo_data(f"{line}\n")
        sys.stdout.flush()

"""`vast exec cluster runs`: list the running and the unsuccessful runs."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from datetime import datetime
from typing import Annotated

import typer

from robovast.campaign.run_record import RunRecord
from robovast.kubeapi.pod_contract.pack_request import RUN
from robovast_cli.commands.exec.cluster.logs import open_runs
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.kube.pods import running_since, waiting_reason
from robovast_cli.kube.runs import CampaignRuns, Executor
from robovast_cli.kube.status import now
from robovast_cli.lazy import examples
from robovast_cli.ui.live_view import clock_time
from robovast_cli.ui.output import echo
from robovast_cli.ui.table import format_table

COLUMNS = ["RUN", "STATE", "TIME", "POD", "NODE", "WHY"]


@examples(
    ("vast exec cluster runs", "List the runs of the only campaign"),
    ("vast exec cluster runs hall-x7k2p --failed", "List failed and errored runs"),
)
def runs(
    campaign: Annotated[
        str | None,
        typer.Argument(metavar="CAMPAIGN", help="Campaign, required if the namespace has several."),
    ] = None,
    failed: Annotated[
        bool, typer.Option("--failed", help="List only failed and errored runs.")
    ] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """List the running and the unsuccessful runs of a campaign.

    Shows the pod of each running run, and the reason of each failed or errored run.
    """
    with open_runs(context, namespace, campaign) as (_, found):
        rows = [] if failed else list(_running(found))
        rows += [_unsuccessful(run, record) for run, record in found.unsuccessful_records()]
        if rows:
            sys.stdout.write(format_table(COLUMNS, rows))
        elif failed:
            echo("No unsuccessful runs.")
        else:
            echo("No running and no unsuccessful runs.")
        if found.campaign is not None:
            echo(f"{found.campaign.name}: {found.campaign.counts()}.")
            for message in () if rows else found.campaign.messages:
                echo(f"    {message}")


def _running(found: CampaignRuns) -> Iterator[list[str]]:
    if found.planned is None:
        return
    for executor in found.executors():
        yield _row(found.planned.path_of(executor.ids[0]), executor)


def _row(first: str, executor: Executor) -> list[str]:
    others = executor.runs - 1
    since = running_since(executor.pod, RUN)
    return [
        f"{first} and {others} more" if others else first,
        "running" if since else "waiting",
        clock_time((now() - datetime.fromisoformat(since)).total_seconds()) if since else "",
        executor.name,
        executor.pod["spec"].get("nodeName") or "",
        "" if since else waiting_reason(executor.pod),
    ]


def _unsuccessful(run: str, record: RunRecord | None) -> list[str]:
    if record is None:
        return [run, "errored", "", "", "", "never stored"]
    return [run, record.verdict, clock_time(record.duration), "", record.host, record.reason]

"""`vast exec cluster runs`: which runs are executed now, which did not pass."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from datetime import datetime

from robovast.campaign.run_record import RunRecord
from robovast.kubeapi.pod_contract.pack_request import RUN
from robovast_cli.commands.exec.cluster.logs import opened_runs
from robovast_cli.kube.pods import running_since, waiting_reason
from robovast_cli.kube.runs import CampaignRuns, Executor
from robovast_cli.kube.status import now
from robovast_cli.ui.live_view import clock_time
from robovast_cli.ui.output import say
from robovast_cli.ui.table import format_table

COLUMNS = ["RUN", "STATE", "TIME", "POD", "NODE", "WHY"]


def runs(context: str | None, namespace: str | None, name: str | None, *, failed: bool) -> None:
    """Print the runs of a campaign that are executed now, and those that did not pass.

    Args:
        context: of the kubeconfig; the current one when None.
        namespace: the context's when None.
        name: of the campaign; the only one, or only unfinished one, when None.
        failed: only those that did not pass.

    Raises:
        InputError: there is no such campaign.
    """
    with opened_runs(context, namespace, name) as (_, found):
        rows = [] if failed else list(_executed(found))
        rows += [_ended(run, record) for run, record in found.bad_records()]
        if rows:
            sys.stdout.write(format_table(COLUMNS, rows))
        elif failed:
            say("No unsuccessful runs.")
        else:
            say("No running and no unsuccessful runs.")
        if found.campaign is not None:
            say(f"{found.campaign.name}: {found.campaign.counts()}.")
            for told in () if rows else found.campaign.messages:
                say(f"    {told}")


def _executed(found: CampaignRuns) -> Iterator[list[str]]:
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


def _ended(run: str, record: RunRecord | None) -> list[str]:
    if record is None:
        return [run, "errored", "", "", "", "never stored"]
    return [run, record.verdict, clock_time(record.duration), "", record.host, record.reason]

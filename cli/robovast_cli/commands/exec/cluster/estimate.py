"""`vast exec cluster run --estimate`: the estimated duration and cost of a campaign."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory

from robovast.base.errors import InputError
from robovast.kubeapi.resources import CampaignSpec
from robovast.kubeapi.submission import SubmitOptions, document_name
from robovast.model.document import Document
from robovast.model.estimate import Forecast, Spent, cores_of, forecast
from robovast.model.expansion import compose, select_any
from robovast_cli.kube.api import connect
from robovast_cli.kube.status import CampaignState, campaign_states, now
from robovast_cli.ui.live_view import clock_time
from robovast_cli.ui.output import echo
from robovast_cli.ui.table import counted


def print_estimate(
    document: Document, options: SubmitOptions, context: str | None, namespace: str | None
) -> None:
    """Print the estimated duration and cost of a campaign of a document.

    Raises:
        InputError: the document is a search, so the number of runs is unknown.
    """
    runs = _runs_of(document, options)
    with connect(context, namespace) as kube:
        known = campaign_states(kube)
        cores = cores_of(document.vast.execution, kube.context or "")
    earlier = list(_find_earlier(document, known))
    workers = options.parallelism or _default_parallelism()
    found = forecast(earlier, runs, workers)
    echo(f"{runs:,} runs, at most {min(runs, workers):,} in parallel.")
    if found is None:
        echo(
            f"No estimate: no campaign of {document_name(document)} has finished in this namespace."
        )
        return
    end = now() + timedelta(seconds=found.seconds)
    echo(
        f"Estimated duration: {clock_time(found.seconds)} (90 % interval {clock_time(found.least)} "
        f"to {clock_time(found.most)}), based on {counted(len(earlier), 'earlier campaign')}. "
        f"If started now, the campaign completes at about {end:%Y-%m-%d %H:%M UTC}."
    )
    if cores:
        echo(_cost(found, cores * min(runs, workers)))


def _runs_of(document: Document, options: SubmitOptions) -> int:
    if document.vast.search is not None:
        raise InputError(
            "cannot estimate a search: its number of runs is unknown.",
            hint="estimate a campaign with a fixed number of runs",
        )
    with TemporaryDirectory() as folder:
        variants = select_any(compose(document, Path(folder)).variants, options.select)
    return len(list(variants)) * (options.runs or document.vast.execution.most_runs)


def _default_parallelism() -> int:
    return int(CampaignSpec.model_fields["parallelism"].default)


def _find_earlier(document: Document, known: Iterable[CampaignState]) -> Iterator[Spent]:
    """Yield the durations of finished campaigns of the same document, without repetitions."""
    name, metadata = document_name(document), document.vast.metadata.get("name")
    for campaign in known:
        spec, status = campaign.resource["spec"], campaign.status
        named = ((spec.get("vast") or {}).get("metadata") or {}).get("name")
        finished = status.state == "Finished" and status.attempt == 1
        if not finished or (spec.get("document"), named) != (name, metadata):
            continue
        if status.start_time and status.completion_time and status.runs.total:
            start, end = map(datetime.fromisoformat, (status.start_time, status.completion_time))
            workers = int(spec.get("parallelism") or _default_parallelism())
            yield Spent(status.runs.total, workers, max(1.0, (end - start).total_seconds()))


def _cost(found: Forecast, cores: float) -> str:
    """Return the estimated CPU-hours, from the requests of the pods."""
    hours = [cores * seconds / 3600 for seconds in (found.seconds, found.least, found.most)]
    interval = f"90 % interval {hours[1]:.2g} to {hours[2]:.2g}"
    return f"Estimated cost: {hours[0]:.2g} CPU-hours ({interval})."

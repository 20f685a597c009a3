"""`vast exec cluster debug`: run one run again in a pod that remains."""

from __future__ import annotations

from robovast.base.errors import CannotRunError
from robovast.kubeapi.pod_contract.debug_pod import HOURS, debug_pod
from robovast.kubeapi.pod_contract.pack_request import RUN
from robovast.kubeapi.resources import ROLE_LABEL, SHARD_ROLE, UID_LABEL
from robovast_cli.commands.exec.cluster.logs import RunNames, open_runs, parse_names
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo


@examples(
    ("vast exec cluster debug hall-1/0", "Run a run of the only campaign again"),
    ("vast exec cluster debug hall-x7k2p hall-1/0", "Name the campaign"),
)
def debug(names: RunNames = None, context: Context = None, namespace: Namespace = None) -> None:
    """Run a run again in a separate pod, and keep the pod for inspection.

    Uses the parameters, seed and image of the run. The results of the campaign do not change.
    """
    name, run = parse_names(names)
    with open_runs(context, namespace, name) as (kube, runs):
        runs.check_accepted()
        campaign, planned = runs.campaign, runs.planned
        if campaign is None or planned is None:
            raise CannotRunError(
                "the Campaign has no runs yet, or was deleted.",
                hint="wait until a run has started, then run the command again",
            )
        id_ = planned.id_of(run)
        jobs = kube.jobs({UID_LABEL: campaign.uid, ROLE_LABEL: SHARD_ROLE})
        if not jobs:
            raise CannotRunError(
                f"cannot create a pod for {run}: no Job of {campaign.name} is left",
                hint="use `vast replay` to run a downloaded run again on this machine",
            )
        pod = kube.create_pod(debug_pod(campaign.resource, jobs[-1], id_))["metadata"]["name"]
        kubectl = "kubectl" + (f" --context {kube.context}" if kube.context else "")
        kubectl += f" --namespace {kube.namespace}"
    inside = "source /config/.robovast/environment.sh && cd /out && bash /config/entrypoint.sh"
    echo(f"{run} runs again in the pod {pod}, which stores no results. After the run, the pod")
    echo(f"remains for at most {HOURS} h. The output of the run is in /out.")
    echo(f"log:    {kubectl} logs --follow {pod} --container {RUN}")
    echo(f"enter:  {kubectl} exec --stdin --tty {pod} --container {RUN} -- bash")
    echo(f"again:  {inside}  (in there)")
    echo(f"delete: {kubectl} delete pod {pod}")

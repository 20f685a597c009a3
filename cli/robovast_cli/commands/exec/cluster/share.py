"""`vast exec cluster upload-to-share`: finished campaigns go from the cluster to the share."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from robovast.base.errors import CannotRunError, ExitCode, InputError, RobovastError
from robovast.kubeapi.resources import MANAGED_BY, MANAGED_LABEL, Scheduling
from robovast.kubeapi.share_job import Upload, agent_image, share_variables
from robovast.storage.folder_ownership import distinct_name
from robovast.storage.shares.campaigns import SHARE_TYPE, Share, open_share
from robovast_cli.commands.exec.cluster.share_jobs import follow, log_command, start
from robovast_cli.commands.results.downloading import Results, named_results, results_of
from robovast_cli.kube.api import Kubernetes, connect
from robovast_cli.kube.status import CampaignState, lookup
from robovast_cli.ui.output import say


@dataclass(frozen=True)
class How:
    """Options for all uploaded campaigns."""

    force: bool
    """Replace existing archives on the share."""
    detach: bool
    """Do not wait for the end."""
    image: str | None
    """Image of the agent; None means that of the campaign's Jobs."""


def upload_to_share(
    context: str | None, namespace: str | None, names: Sequence[str], how: How
) -> ExitCode:
    """Upload the named campaigns, or all that are finished, each by a Job.

    Args:
        context: of the kubeconfig; the current one when None.
        namespace: the context's when None.
        names: of Campaigns or results folders; none means all finished Campaigns.
        how: what else was asked for.

    Raises:
        RobovastError: the share cannot be used; or one was not uploaded, and the others were.
    """
    with open_share() as share:
        share.verify()
        variables = share_variables(os.environ[SHARE_TYPE], share.provider, Path.cwd())
        with connect(context, namespace) as kube:
            known = [CampaignState(item) for item in kube.campaigns()]
            uploads = _Uploads(kube, share, variables, how)
            try:
                for results in _chosen(kube, known, names):
                    uploads.upload(_told_apart(results, known))
            except KeyboardInterrupt:
                say("\nDisplay stopped. A started upload continues in the cluster.")
                return ExitCode.INTERRUPTED
    if uploads.errors:
        raise type(uploads.errors[0])("\n".join(map(str, uploads.errors)))
    return ExitCode.OK


class _Uploads:
    """Uploads one campaign after the other; a fault in one keeps none of the others."""

    def __init__(
        self, kube: Kubernetes, share: Share, variables: Mapping[str, str], how: How
    ) -> None:
        self._kube = kube
        self._share = share
        self._variables = variables
        self._how = how
        self.errors: list[RobovastError] = []

    def upload(self, results: Results) -> None:
        """Upload results, unless they are on the share."""
        name = results.name
        if not self._how.force and self._is_there(name):
            say(f"{name}: exists on the file share; `--force` replaces it.")
            return
        try:
            self._upload(results)
        except RobovastError as error:
            self.errors.append(error)

    def _upload(self, results: Results) -> None:
        name, kube, owner = results.name, self._kube, results.campaign
        upload = Upload(
            campaign=name,
            bucket=results.bucket,
            endpoint=results.place.endpoint,
            image=self._how.image or _agent_image(kube),
            region=results.place.region,
            secret=results.place.secret,
            owner=owner.resource if owner else None,
            scheduling=owner.scheduling if owner else Scheduling(),
        )
        if not start(kube, upload, self._variables):
            say(f"{name}: another upload is in progress.")
        if self._how.detach:
            say(f"{name}: upload started. Log: {log_command(kube, upload.job)}")
            return
        follow(kube, upload.job, name, lambda line: say(f"{name}: {line}"))
        with suppress(CannotRunError):  # who may not delete it leaves that to its time to live
            kube.delete_job(upload.job)

    def _is_there(self, name: str) -> bool:
        try:
            return self._share.has(name)
        except RobovastError as error:
            say(f"{name}: cannot check the file share, so the campaign is uploaded. {error}")
            return False


def _chosen(
    kube: Kubernetes, known: Sequence[CampaignState], names: Sequence[str]
) -> list[Results]:
    """Results by name, or those of all campaigns that are finished.

    Raises:
        InputError: there is none, none of a name, or it is not finished.
    """
    for name in names:
        campaign = lookup(known, name)
        if campaign is not None and not campaign.finished:
            raise InputError(
                f"{name} is not finished; its state is {campaign.status.state}",
                hint="run `vast exec cluster monitor` to see its progress",
            )
    if names:
        return [named_results(kube, known, name) for name in dict.fromkeys(names)]
    stored = [campaign for campaign in known if campaign.finished and campaign.bucket]
    for campaign in known:
        if not campaign.finished:
            say(f"{campaign.name}: skipped, because it is not finished.")
    if not stored:
        raise InputError(
            f"no campaign in the namespace {kube.namespace} is finished and has results",
            hint="select another namespace with `--namespace`, or name a deleted Campaign with "
            "`--campaign`",
        )
    return [results_of(campaign) for campaign in stored]


def _told_apart(results: Results, known: Sequence[CampaignState]) -> Results:
    """Results under a name that no other campaign of the namespace has."""
    alike = [campaign for campaign in known if campaign.folder == results.name]
    if len(alike) < 2 or results.campaign is None:
        return results
    return replace(results, name=distinct_name(results.name, results.campaign.uid))


def _agent_image(kube: Kubernetes) -> str:
    image = agent_image(reversed(kube.jobs({MANAGED_LABEL: MANAGED_BY})))
    if image is None:
        raise CannotRunError(
            "cannot determine the agent image of this cluster: no Job of a campaign is left in "
            f"the namespace {kube.namespace}",
            hint="set it with `--image`",
        )
    return image

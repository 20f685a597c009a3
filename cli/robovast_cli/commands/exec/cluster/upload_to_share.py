"""`vast exec cluster upload-to-share`: upload finished campaigns to the file share."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from robovast.base.errors import CannotRunError, ExitCode, InputError, RobovastError
from robovast.kubeapi.resources import MANAGED_BY, MANAGED_LABEL, Scheduling
from robovast.kubeapi.share_job import Upload, agent_image, share_variables
from robovast.storage.folder_ownership import distinct_name
from robovast.storage.shares.campaigns import SHARE_TYPE, Share, open_share
from robovast_cli.commands.exec.cluster.upload_jobs import follow, log_command, start
from robovast_cli.kube.api import KubernetesClient, connect
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.kube.results import Results, named_results, stored_results
from robovast_cli.kube.status import CampaignState, campaign_states, lookup
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo


@dataclass(frozen=True)
class UploadOptions:
    """Options for all uploaded campaigns."""

    force: bool
    """Replace existing archives on the share."""
    detach: bool
    """Start the upload and exit."""
    image: str | None
    """Image of the agent; None for the image of the campaign's Jobs."""


@examples(
    ("vast exec cluster upload-to-share", "Upload all finished campaigns"),
    ("vast exec cluster upload-to-share -i hall-x7k2p --force", "Replace the archive of one"),
)
def upload_to_share(
    campaign: Annotated[
        list[str] | None,
        typer.Option(
            "-i",
            "--campaign",
            metavar="NAME",
            help="Campaign, by its name or the name of its results folder (default: all finished "
            "campaigns of the namespace) (repeatable).",
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Replace existing archives on the file share.")
    ] = False,
    detach: Annotated[bool, typer.Option("--detach", help="Start the upload and exit.")] = False,
    image: Annotated[
        str | None,
        typer.Option(
            "--image",
            help="Image of the RoboVAST agent, for example with your own share provider "
            "(default: the agent image of the campaigns).",
        ),
    ] = None,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Upload results of finished campaigns to the remote file share.

    The upload runs in the cluster. Ctrl-C stops only the display. Existing archives are kept.

    ROBOVAST_SHARE_TYPE (nextcloud, webdav, sftp or gcs) and the variables of its type describe the
    file share. Set them in the environment or in a `.env` file in this folder or above. The
    documentation lists the variables on the page "Publish, merge, import and share results".
    """
    options = UploadOptions(force, detach, image)
    with open_share() as share:
        share.verify()
        variables = share_variables(os.environ[SHARE_TYPE], share.provider, Path.cwd())
        with connect(context, namespace) as kube:
            known = campaign_states(kube)
            uploads = _Uploads(kube, share, variables, options)
            try:
                for results in _select_results(kube, known, campaign or ()):
                    uploads.upload(_rename_duplicate(results, known))
            except KeyboardInterrupt:
                echo("\nDisplay stopped. A started upload continues in the cluster.")
                return ExitCode.INTERRUPTED
    if len(uploads.errors) == 1:
        raise uploads.errors[0]
    if uploads.errors:
        raise type(uploads.errors[0])("\n".join(map(str, uploads.errors)))
    return ExitCode.OK


class _Uploads:
    """Uploads campaigns in sequence; continues after an error."""

    def __init__(
        self,
        kube: KubernetesClient,
        share: Share,
        variables: Mapping[str, str],
        options: UploadOptions,
    ) -> None:
        self._kube = kube
        self._share = share
        self._variables = variables
        self._options = options
        self.errors: list[RobovastError] = []

    def upload(self, results: Results) -> None:
        """Upload results, unless they are on the share."""
        name = results.name
        if not self._options.force and self._is_uploaded(name):
            echo(f"{name}: exists on the file share; `--force` replaces it.")
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
            image=self._options.image or _agent_image(kube),
            region=results.place.region,
            secret=results.place.secret,
            owner=owner.resource if owner else None,
            scheduling=owner.scheduling if owner else Scheduling(),
        )
        if not start(kube, upload, self._variables):
            echo(f"{name}: another upload is in progress.")
        if self._options.detach:
            echo(f"{name}: upload started. Log: {log_command(kube, upload.job)}")
            return
        follow(kube, upload.job, name, lambda line: echo(f"{name}: {line}"))
        with suppress(CannotRunError):  # without permission, Kubernetes deletes it later
            kube.delete_job(upload.job)

    def _is_uploaded(self, name: str) -> bool:
        try:
            return self._share.has(name)
        except RobovastError as error:
            echo(f"{name}: cannot check the file share, so the campaign is uploaded. {error}")
            return False


def _select_results(
    kube: KubernetesClient, known: Sequence[CampaignState], names: Sequence[str]
) -> list[Results]:
    """Return results by name (default: of all finished campaigns).

    Raises:
        InputError: no campaign has this name, or it is not finished, or no campaign is.
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
    for campaign in known:
        if not campaign.finished:
            echo(f"{campaign.name}: skipped, because it is not finished.")
    finished = [campaign for campaign in known if campaign.finished]
    return stored_results(kube, finished, "is finished and has results")


def _rename_duplicate(results: Results, known: Sequence[CampaignState]) -> Results:
    """Return results under a name that no other campaign of the namespace has."""
    alike = [campaign for campaign in known if campaign.folder == results.name]
    if len(alike) < 2 or results.campaign is None:
        return results
    return replace(results, name=distinct_name(results.name, results.campaign.uid))


def _agent_image(kube: KubernetesClient) -> str:
    image = agent_image(reversed(kube.jobs({MANAGED_LABEL: MANAGED_BY})))
    if image is None:
        raise CannotRunError(
            "cannot determine the agent image of this cluster: no Job of a campaign is left in "
            f"the namespace {kube.namespace}",
            hint="set it with `--image`",
        )
    return image

"""A campaign as its pods know it: the plan, the inputs, the variants."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from robovast.agent.bucket import Bucket
from robovast.agent.composed import ComposedVariants
from robovast.agent.digests import check_files
from robovast.agent.mounts import Folders
from robovast.agent.sources import copy_inputs
from robovast.base.backoff import REPEATABLE
from robovast.base.errors import InputError
from robovast.base.ranges import Span
from robovast.campaign.configurations import (
    variants_digest,
)
from robovast.campaign.layout import Layout
from robovast.kubeapi.pod_contract.exit_codes import PlanError
from robovast.kubeapi.pod_contract.storage_address import passed_address
from robovast.model.document import Document, load_document
from robovast.model.expansion import Composition, Variant, compose, select_any
from robovast.model.expansion.containers import refuse_containers
from robovast.model.naming import CONFIG
from robovast.model.packs import CampaignPlan, PlanSpec
from robovast.model.repetition import list_key, parse_list
from robovast.storage.endpoint import Credentials
from robovast.storage.s3 import ObjectStore


@dataclass(frozen=True)
class PodCampaign:
    """A campaign as a pod sees it."""

    plan: CampaignPlan
    folders: Folders
    store: ObjectStore

    @property
    def packs(self) -> PlanSpec:
        """The packs of the campaign's runs.

        Raises:
            PlanError: the document is not expanded yet.
        """
        if self.plan.plan is None:
            raise PlanError(f"{self.folders.plan / 'campaign.json'}: `plan` is missing.")
        return self.plan.plan

    @property
    def bucket(self) -> Bucket:
        """The bucket of the results."""
        return Bucket(self.store, self.plan.bucket, self.plan.owner)


def open_campaign(folders: Folders, *, connections: int = 8) -> PodCampaign:
    """The campaign whose plan is mounted.

    Args:
        folders: of the pod.
        connections: to the S3 server.

    Raises:
        PlanError: there is no plan, or none of this version.
        StorageError: there are no credentials.
    """
    plan = read_plan(folders.campaign_plan)
    credentials = Credentials.from_folder(folders.credentials)
    address = passed_address()
    store = ObjectStore(address, credentials, connections=connections, patience=REPEATABLE)
    return PodCampaign(plan, folders, store)


def read_plan(path: Path) -> CampaignPlan:
    """A mounted `campaign.json`.

    Raises:
        PlanError: there is none, or none of this version.
    """
    try:
        return CampaignPlan.model_validate_json(path.read_bytes())
    except (OSError, ValidationError) as error:
        raise PlanError(
            f"{path}: is not a valid plan of this version: {error}",
            hint="operator and agent must have the same version. Check whether only one of them "
            "was updated",
        ) from None


def bad_runs(store: ObjectStore, bucket: str, name: str) -> list[Span]:
    """The runs that are repeated, as `finish` stored them.

    Args:
        store: where the bucket is.
        bucket: the campaign's.
        name: of the list.

    Raises:
        ValueError: they are not there, or not as they were stored.
        StorageError: the bucket cannot be read.
    """
    content = store.read(bucket, list_key(name))
    if content is None:
        raise ValueError(f"the bucket has no {list_key(name)}, which names them")
    return parse_list(name, content)


def load_inputs(campaign: PodCampaign) -> Document:
    """Load the document with its files into the pod.

    Raises:
        InputError: the document or its files are wrong.
        StorageError: they cannot be fetched.
    """
    folder = campaign.folders.inputs
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    copy_inputs(campaign.plan, campaign.folders, campaign.store, folder)
    check_files(campaign.plan.inputs, folder)
    document = folder / campaign.plan.document
    shutil.copyfile(campaign.folders.document, document)
    return load_document(document)


def expand(
    plan: CampaignPlan, document: Document, scratch: Path, message: Callable[[str], None]
) -> Composition:
    """Expand a document, and return the variants that the campaign selects.

    Args:
        plan: the campaign's.
        document: with its files.
        scratch: a folder that is made anew.
        message: is given what there is to say.

    Raises:
        InputError: it cannot be expanded, or nothing is selected.
    """
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir(parents=True)
    composition = compose(document, scratch, message, refuse_containers)
    chosen = select_any(composition.variants, plan.select)
    _check_expansion(plan, chosen)
    return Composition(tuple(chosen), composition.input_files, composition.transient_files)


def _check_expansion(plan: CampaignPlan, variants: Sequence[Variant]) -> None:
    first = 0
    for entry in plan.entries:
        found = variants[first : first + entry.variants]
        first += entry.variants
        if entry.digest is not None and variants_digest(found) != entry.digest:
            raise InputError(
                f"{plan.document}: the configuration `{entry.name}` does not expand to the "
                "planned configurations. A cause can be an update of operator and agent while "
                "the campaign ran",
                hint="create another Campaign for the remaining runs",
            )


def open_composed(campaign: PodCampaign) -> tuple[Document, Sequence[Variant]]:
    """Read document and variants as the compose Job stored them in the bucket.

    Files of the variants are not there yet: `fetch_variant_files` brings those of one.

    Raises:
        InputError: there is no composed campaign, or it is not the one that was planned.
        StorageError: it cannot be fetched.
    """
    layout = Layout(campaign.folders.inputs)
    shutil.rmtree(layout.root, ignore_errors=True)
    download(campaign, f"{CONFIG}/", layout.root)
    if campaign.plan.composed is None:
        raise InputError(f"the plan of {campaign.plan.campaign} names no list of variants.")
    growing = campaign.plan.expansion == "proposed"
    composed = ComposedVariants(campaign.bucket, layout, campaign.plan.composed, growing=growing)
    check_files(composed.inputs, layout.config)
    return load_document(layout.config / composed.document, search=False), composed


def fetch_variant_files(
    campaign: PodCampaign, variants: Sequence[Variant], variant: Variant
) -> None:
    """Download the files of a composed variant.

    Raises:
        InputError: one of them is not what was composed.
        StorageError: they cannot be fetched.
    """
    if variant.files:
        download(campaign, f"{variant.name}/{CONFIG}/", campaign.folders.inputs)
    if isinstance(variants, ComposedVariants):
        check_files(variants.files[variant.name], campaign.folders.inputs)


def download(campaign: PodCampaign, prefix: str, folder: Path) -> None:
    """Download all objects of the campaign below a prefix."""
    for item in campaign.store.objects(campaign.plan.bucket, prefix):
        target = Path(os.path.normpath(folder / item.key))
        if target.is_relative_to(folder):
            campaign.store.get_file(campaign.plan.bucket, item, target)

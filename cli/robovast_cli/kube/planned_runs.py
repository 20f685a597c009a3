"""Ids and folders of the runs of a campaign, from its plan in the cluster."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from pydantic import ValidationError

from robovast.base.errors import InputError
from robovast.base.optional_deps import CLUSTER
from robovast.base.ranges import ids, merge, parse_ranges
from robovast.base.yaml_files import parse_yaml
from robovast.kubeapi.names import child_name
from robovast.kubeapi.pod_contract.mounts import DOCUMENT_FILE, PLAN_FILE
from robovast.kubeapi.resources import UID_LABEL, CampaignSpec
from robovast.kubeapi.source_files import Files, check_paths, config_map_files, inline_files
from robovast.model.document import load_document
from robovast.model.packs import CampaignPlan, PlanSpec
from robovast.model.variations.loader import all_pure
from robovast_cli.kube.api import Json, KubernetesClient
from robovast_cli.kube.status import CampaignState

if TYPE_CHECKING:
    from robovast.storage.s3 import ObjectStore


def split_run(run: str) -> tuple[str, int]:
    """Return the configuration and the number of the run in a folder.

    Raises:
        ValueError: no run has such a folder.
    """
    variant, _, number = run.rpartition("/")
    if run != f"{variant}/{int(number)}" or "/" in variant or not run.isprintable():
        raise ValueError(run)
    if variant in {"", ".", ".."}:
        raise ValueError(run)
    return variant, int(number)


@dataclass(frozen=True)
class RunNames:
    """Converts between ids and folders of runs."""

    plan: PlanSpec
    names: Sequence[str]
    """Names of all configurations, in the order of the plan."""

    def id_of(self, run: str) -> int:
        """Return the id of a run by its folder `<configuration>/<number>`.

        Raises:
            InputError: there is no such run.
        """
        try:
            variant, number = split_run(run)
            return self.plan.id_of(self.names.index(variant), number)
        except (ValueError, IndexError):
            raise InputError(
                f"the campaign has no run `{run}`; it has {self.plan.total} runs, from "
                f"{self.path_of(0)} to {self.path_of(self.plan.total - 1)}.",
                hint="name one of these runs",
            ) from None

    def path_of(self, id_: int) -> str:
        """Return the folder of a run, `<configuration>/<number>`."""
        variant, number = self.plan.run(id_)
        return f"{self.names[variant]}/{number}"

    def find_commands(self, *ranges: str) -> list[str]:
        """Return the folders of the runs in ranges of ids."""
        spans = merge(span for text in ranges for span in parse_ranges(text))
        return [self.path_of(id_) for id_ in ids(spans)]


def planned_runs(
    kube: KubernetesClient, campaign: CampaignState, store: Callable[[], ObjectStore]
) -> RunNames | None:
    """Return the runs of a campaign; None before they are planned.

    Args:
        kube: client of the cluster.
        campaign: campaign with the runs.
        store: opens the store, which has the configurations if plugins have created them.

    Raises:
        InputError: the configurations cannot be determined.
        StorageError: the bucket cannot be read.
    """
    maps = kube.config_maps({UID_LABEL: campaign.uid})
    plans = [found for found in map(_plan_of, maps) if found is not None]
    newest = max(plans, key=lambda found: found[0].total, default=None)
    if newest is None:
        return None
    spec, plan, text = newest
    with TemporaryDirectory() as folder:
        if plan.expansion != "pure":
            return RunNames(spec, _stored_names(plan, store(), Path(folder)))
        files = _files(kube, campaign)
        return RunNames(spec, _expand_names(plan, text, files, Path(folder)))


def _plan_of(config_map: Json) -> tuple[PlanSpec, CampaignPlan, str] | None:
    """Return the plan and the `.vast` file in a ConfigMap, or None."""
    data = config_map.get("data") or {}
    try:
        plan = CampaignPlan.model_validate_json(data[PLAN_FILE])
        return (plan.plan, plan, data[DOCUMENT_FILE]) if plan.plan is not None else None
    except (KeyError, ValidationError):
        return None


def _files(kube: KubernetesClient, campaign: CampaignState) -> Files:
    """Return the files of a `.vast` file that the operator expands."""
    source = CampaignSpec.model_validate(campaign.resource["spec"]).source.config_map
    if source is None:
        return inline_files(campaign.resource["spec"])
    copy = kube.config_map(child_name(campaign.name, campaign.uid, "files")) or {}
    return config_map_files(copy, {item.key: item.path for item in source.items})


def _expand_names(plan: CampaignPlan, text: str, files: Files, folder: Path) -> list[str]:
    """Return the configuration names of a `.vast` file whose expansion runs no user code."""
    from robovast.agent.campaign import expand

    try:
        check_paths(files)
        if not all_pure(parse_yaml(text)):
            raise ValueError("its variations require plugins")
    except ValueError as error:
        raise InputError(
            f"the plan of the campaign is invalid: {error}.",
            hint="use the same version of RoboVAST as the operator",
        ) from error
    for path, content in {**files, plan.document: text.encode()}.items():
        target = folder / "inputs" / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
    document = load_document(folder / "inputs" / plan.document)
    composition = expand(plan, document, folder / "made", lambda _: None)
    return [variant.name for variant in composition.variants]


def _stored_names(plan: CampaignPlan, store: ObjectStore, folder: Path) -> list[str]:
    """Return the configuration names that the expansion Job has stored."""
    with CLUSTER.needed_by("Access to a cluster"):
        from robovast.agent.campaign import PodCampaign, open_composed
        from robovast.agent.mounts import Folders

    _, variants = open_composed(PodCampaign(plan, Folders(work=folder), store))
    return [variant.name for variant in variants]

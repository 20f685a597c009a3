"""What a pod finds whose Job has brought its files with it, as a kubelet and the agent make it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

from robovast.agent.mounts import Folders
from robovast.agent.sources import copy_inputs
from robovast.model.packs import CampaignPlan
from robovast.storage.s3 import ObjectStore


def shown(pod: Any, volume: str) -> dict[str, str]:
    """The files in a volume of the downward API, by path.

    Args:
        pod: a pod, or the template of one.
        volume: its name.
    """
    (found,) = (v for v in pod["spec"]["volumes"] if v["name"] == volume)
    sources = [found, *found.get("projected", {}).get("sources", ())]
    items = [item for source in sources for item in source.get("downwardAPI", {}).get("items", ())]
    texts = {f"metadata.annotations['{k}']": v for k, v in pod["metadata"]["annotations"].items()}
    return {item["path"]: texts[item["fieldRef"]["fieldPath"]] for item in items}


def plan_of(pod: Any) -> CampaignPlan:
    """The plan that a pod finds."""
    return CampaignPlan.model_validate_json(shown(pod, "plan")["campaign.json"])


def inputs_of(pod: Any, folder: Path) -> dict[str, Path]:
    """The campaign's files that a pod finds, by path.

    Args:
        pod: a pod, or the template of one.
        folder: where to put them; it is empty.
    """
    mounted, target = folder / "mounted", folder / "inputs"
    for path, text in shown(pod, "files").items():
        (mounted / path).parent.mkdir(parents=True, exist_ok=True)
        (mounted / path).write_text(text)
    copy_inputs(plan_of(pod), Folders(files=mounted), cast(ObjectStore, None), target)
    return {p.relative_to(target).as_posix(): p for p in target.rglob("*") if p.is_file()}

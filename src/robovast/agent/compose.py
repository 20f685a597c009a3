"""`compose`: expands a document that the operator must not expand, and stores the result."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from robovast.agent.campaign import PodCampaign, expand, load_inputs, open_campaign
from robovast.agent.composed import store_composed
from robovast.agent.digests import file_digest
from robovast.agent.mounts import Folders
from robovast.agent.untrusted_files import SIDE_BY_SIDE, store_own_tree
from robovast.base.errors import InputError
from robovast.campaign.layout import CONFIGURATIONS, Layout
from robovast.execution.generate import write_configurations
from robovast.kubeapi.pod_contract.exit_codes import AgentExit
from robovast.kubeapi.pod_contract.messages import LIMIT, Composed
from robovast.model.document import Document
from robovast.model.expansion import Composition, Variant
from robovast.model.expansion.expand import DEFAULT_ENTRY
from robovast.model.packs import format_breaks
from robovast.model.plan import breaks

DIGEST_LIMIT = 100
"""Space reserved in the message for the digest, which is known last [byte]."""


def compose(folders: Folders) -> AgentExit:
    """Expand the document, and store its inputs and variants in the bucket.

    Raises:
        InputError: the document or its files are wrong, or a variation type fails.
        StorageError: the bucket cannot be written.
    """
    campaign = open_campaign(folders, connections=SIDE_BY_SIDE)
    campaign.bucket.claim()
    document = load_inputs(campaign)
    composition = expand(campaign.plan, document, campaign.folders.scratch, print)
    found = Counter(variant.entry for variant in composition.variants)
    entries = document.vast.configuration or [DEFAULT_ENTRY]
    message = Composed(
        counts=tuple(found[entry.name] for entry in entries),
        breaks=format_breaks(breaks(composition.variants)),
    )
    if len(message.text) > LIMIT - DIGEST_LIMIT:
        raise InputError(
            f"{campaign.plan.document}: has {len(entries)} configuration entries, more than a "
            "campaign on a cluster can have when plugins expand it",
            hint="divide it into several",
        )
    layout = store_inputs(campaign, document, composition)
    inputs = files_below(layout.config)
    variants = composition.variants
    made = store_composed(campaign.bucket, document.path.name, inputs, variants)
    message.model_copy(update={"digest": made}).write(folders.message)
    return AgentExit.PASSED


def files_below(folder: Path) -> dict[str, str]:
    """SHA-256 of the files below a folder, by path."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {path.relative_to(folder).as_posix(): file_digest(path) for path in files}


def store_inputs(
    campaign: PodCampaign,
    document: Document,
    composition: Composition,
    earlier: Sequence[Variant] = (),
) -> Layout:
    """Store the folders `_config` and `_transient`, and each variant's `_config`; returns them.

    The list of configurations comes last: who finds it finds everything.

    Args:
        campaign: the campaign.
        document: its document.
        composition: the variants to store.
        earlier: variants that are stored already; they come first in the list.
    """
    bucket = campaign.bucket
    folder = campaign.folders.work / "campaign"
    shutil.rmtree(folder, ignore_errors=True)
    write_configurations(document, composition, folder, timings=True, earlier=earlier)
    there = {item.key for item in bucket.store.objects(bucket.name)}
    store_own_tree(bucket, folder, there=there, skipped={CONFIGURATIONS})
    bucket.store.put_file(bucket.name, CONFIGURATIONS, folder / CONFIGURATIONS)
    return Layout(folder)

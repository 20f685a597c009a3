"""Builds commands that give configurations of a campaign of a cluster more runs."""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError
from robovast.campaign.layout import SCENARIO_CONFIG, VARIANT_RECORD
from robovast.evaluation.confined_files import resolved
from robovast.evaluation.summaries import VariantRuns
from robovast.kubeapi.resources import API_VERSION
from robovast.model.naming import CONFIG

CAMPAIGN = "NAME"
"""Stands for the Campaign, whose name the results do not say."""
_RUNS = "\x00"
"""Stands for the number; nothing else has this character in JSON."""
_USUAL_FILES = frozenset(map(os.path.basename, (SCENARIO_CONFIG, VARIANT_RECORD)))
_LONGEST = 80
"""Most characters of a variant's name in that of an entry, which has at most 100."""


@dataclass(frozen=True)
class ClusterCommand:
    """A command between whose parts a number of runs stands."""

    parts: Sequence[str]
    of_all: bool
    """Whether it is the number in all of every configuration, else that of further ones of the
    chosen ones."""


def more_in_cluster(
    results: Path, campaign: str, variants: Sequence[VariantRuns], chosen: Collection[str]
) -> ClusterCommand:
    """The command that gives configurations of a campaign of a cluster more runs.

    A Configuration has parameters, but no files. Where a chosen one has files of its own, such as a
    map, all are given more runs.

    Args:
        results: the results folder.
        campaign: the campaign's folder in it.
        variants: all its configurations.
        chosen: names of those that are to have more runs.
    """
    given = [variant for variant in variants if variant.name in chosen]
    if any(_has_files(results, f"{campaign}/{variant.name}/{CONFIG}") for variant in given):
        patch = f'{{"spec": {{"runs": {_RUNS}}}}}'
        text = f"kubectl patch campaign {CAMPAIGN} --type merge -p '{patch}'"
        return ClusterCommand(text.split(_RUNS), of_all=True)
    entries = {variant.entry for variant in variants}
    made = "".join(f"---\n{json.dumps(_configuration(one, entries))}\n" for one in given)
    text = f"kubectl create -f - <<'END'\n{made}END"
    return ClusterCommand(text.split(json.dumps(_RUNS)), of_all=False)


def _configuration(variant: VariantRuns, taken: Collection[str]) -> dict[str, Any]:
    """A Configuration that adds runs with a variant's parameters under a name of its own."""
    base = f"{variant.name[:_LONGEST]}-more"
    names = (base if number == 1 else f"{base}-{number}" for number in range(1, len(taken) + 2))
    shown = {key: value for key, value in variant.parameters.items() if not key.startswith("_")}
    return {
        "apiVersion": API_VERSION,
        "kind": "Configuration",
        "metadata": {"generateName": "more-"},
        "spec": {
            "campaign": CAMPAIGN,
            "name": next(name for name in names if name not in taken),
            "parameters": [{key: value} for key, value in shown.items()],
            "runs": _RUNS,
        },
    }


def _has_files(results: Path, folder: str) -> bool:
    try:
        return not _USUAL_FILES.issuperset(os.listdir(resolved(results, folder)))
    except (InputError, OSError):  # it has none
        return False

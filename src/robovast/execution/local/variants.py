"""Selects the variants that a local campaign executes, and its seed."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

from robovast.execution.local.events import LocalOptions
from robovast.model.document import Document
from robovast.model.document.section import merge_pairs
from robovast.model.expansion import Composition, compose, select_any
from robovast.model.seeds import draw_seed


def choose_variants(
    document: Document, scratch: Path, options: LocalOptions, message: Callable[[str], None]
) -> Composition:
    """The variants to run, with the document's overrides for local runs."""
    composition = compose(document, scratch, message)
    variants = select_any(composition.variants, options.select)
    overrides = merge_pairs(document.vast.execution.local.parameter_overrides)
    changed = (
        dataclasses.replace(variant, parameters={**variant.parameters, **overrides})
        for variant in variants
    )
    return dataclasses.replace(composition, variants=tuple(changed))


def campaign_seed(document: Document) -> int:
    """The seed of a new campaign: the document's, or one drawn at random."""
    given = document.vast.execution.seed
    return draw_seed() if given is None else given

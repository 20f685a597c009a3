"""The plan of a campaign that grows: what a search has proposed so far."""

from __future__ import annotations

from dataclasses import dataclass, field

from robovast.model.expansion import Variant
from robovast.model.packs import Block


@dataclass(kw_only=True)
class GrowingPlan:
    """Variants and blocks of runs; both are only appended to."""

    variants: list[Variant] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
    """They may be of variants that are not made yet."""

    @property
    def total(self) -> int:
        """Number of planned runs."""
        return sum(block.size for block in self.blocks)

    def index(self, name: str) -> int | None:
        """Position of a variant; None if it is unknown."""
        return next((i for i, variant in enumerate(self.variants) if variant.name == name), None)

    def runs_of(self, name: str) -> int:
        """Number of planned runs of a variant."""
        index = self.index(name)
        return 0 if index is None else runs_of(self.blocks, index)


def runs_of(blocks: list[Block], variant: int) -> int:
    """Number of planned runs of a variant, by its position."""
    return sum(
        block.runs
        for block in blocks
        if block.first_variant <= variant < block.first_variant + block.variants
    )

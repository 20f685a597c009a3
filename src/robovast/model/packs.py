"""The plan of a campaign: which run is which, which runs are one pack.

It is small, whatever the number of runs, never changes an id that was given, and is shared by
all who execute runs: here, the operator (how many pods?) and the agent (which runs are mine?).
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise
from typing import Annotated, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeInt,
    PositiveInt,
    field_validator,
    model_validator,
)

from robovast.base import docstrings
from robovast.base.ranges import (
    Span,
    clip,
    format_ranges,
    ids,
    merge,
    parse_ranges,
    spans,
    subtract,
)

RUNS_LIMIT = 10_000_000
"""Most runs of a campaign; a cluster could not execute more."""

SETS_LIMIT = 10_000
"""Most parameter sets of a search's batch, each a variant."""


class _Data(BaseModel):
    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        use_attribute_docstrings=docstrings.READ,
        defer_build=True,
    )


class Block(_Data):
    """Consecutive run ids: the same run numbers of consecutive variants.

    The runs of a variant stay together. Raising the number of runs appends a block, and so does
    adding a configuration later.
    """

    first_variant: NonNegativeInt
    variants: PositiveInt
    first_run: NonNegativeInt = 0
    runs: PositiveInt

    @property
    def size(self) -> int:
        """Number of run ids."""
        return self.variants * self.runs


class Round(_Data):
    """Consecutive run ids that are cut into packs at one time, by what was measured until then."""

    runs: PositiveInt
    """How many they are."""
    size: PositiveInt
    """Runs of each pack; the last one before a break may be smaller."""


@dataclass(frozen=True, slots=True)
class _Segment:
    """Run ids that are cut into packs of one size; the last pack may be smaller."""

    first_id: int
    size: int
    first_pack: int
    runs_per_pack: int

    @property
    def packs(self) -> int:
        return -(-self.size // self.runs_per_pack)


class PlanSpec(_Data):
    """Blocks of run ids and how they are cut into packs."""

    blocks: tuple[Block, ...]
    runs_per_job: PositiveInt = 1
    breaks: str = ""
    """Indexes of variants that cannot share a pack with the previous variant, as ranges."""
    by_variant: bool = False
    """Whether each pack is all runs of a variant in a block, because their verdicts decide together
    how many of them are needed; `runs_per_job` is what one start of the pack executes at most.
    """
    awaited: NonNegativeInt | None = None
    """Of a search: how many of the first blocks have ended when it proposes further ones; all of
    them when None.
    """
    rounds: tuple[Round, ...] | None = None
    """What is cut into packs so far, where packs are measured (`runs_per_job: auto`); later plans
    append to it. None where all runs are in packs of `runs_per_job`.
    """

    @field_validator("breaks")
    @classmethod
    def _check_breaks(cls, breaks: str) -> str:
        parse_ranges(breaks)
        return breaks

    @model_validator(mode="after")
    def _check_size(self) -> PlanSpec:
        if self.total > RUNS_LIMIT:
            raise ValueError(f"{self.total} runs are more than a campaign can have: {RUNS_LIMIT}")
        if self.in_packs > self.total:
            raise ValueError(f"packs of {self.in_packs} runs are planned, of {self.total}")
        return self

    @cached_property
    def total(self) -> int:
        """Number of runs; their ids are 0 to `total` - 1."""
        return sum(block.size for block in self.blocks)

    @property
    def awaited_blocks(self) -> tuple[Block, ...]:
        """The blocks that have ended when a search proposes further ones."""
        return self.blocks[: self.awaited]

    @property
    def in_packs(self) -> int:
        """How many of the runs are in packs: the first ones."""
        return self.total if self.rounds is None else sum(round_.runs for round_ in self.rounds)

    @property
    def runs_per_pack(self) -> int:
        """Most runs of a pack."""
        return RUNS_LIMIT if self.by_variant else self.runs_per_start

    @property
    def runs_per_start(self) -> int:
        """Most runs that one start of a pack executes."""
        return max((round_.size for round_ in self.rounds or ()), default=self.runs_per_job)

    def of_round(self, number: int) -> Span:
        """The run ids of a round."""
        assert self.rounds is not None  # noqa: S101  # the caller knows of it
        first = sum(round_.runs for round_ in self.rounds[:number])
        return first, first + self.rounds[number].runs - 1

    @cached_property
    def packs(self) -> int:
        """Number of packs."""
        if not self._segments:
            return 0
        last = self._segments[-1]
        return last.first_pack + last.packs

    def pack(self, index: int) -> range:
        """The run ids of a pack.

        Raises:
            IndexError: there is no such pack.
        """
        if not 0 <= index < self.packs:
            raise IndexError(f"pack {index} of {self.packs}")
        at = bisect_right(self._segments, index, key=lambda segment: segment.first_pack) - 1
        segment = self._segments[at]
        first = (index - segment.first_pack) * segment.runs_per_pack
        last = min(first + segment.runs_per_pack, segment.size)
        return range(segment.first_id + first, segment.first_id + last)

    def run(self, id_: int) -> tuple[int, int]:
        """Variant index and run number (name of the results folder) of a run id.

        Raises:
            IndexError: there is no such run.
        """
        first = 0
        for block in self.blocks:
            if first <= id_ < first + block.size:
                variant, number = divmod(id_ - first, block.runs)
                return block.first_variant + variant, block.first_run + number
            first += block.size
        raise IndexError(f"run {id_} of {self.total}")

    def id_of(self, variant: int, number: int) -> int:
        """Run id of a variant index and a run number.

        Raises:
            IndexError: there is no such run.
        """
        first = 0
        for block in self.blocks:
            place, run = variant - block.first_variant, number - block.first_run
            if 0 <= place < block.variants and 0 <= run < block.runs:
                return first + place * block.runs + run
            first += block.size
        raise IndexError(f"run {number} of variant {variant}")

    def numbers_of(self, variant: int) -> dict[int, int]:
        """Run ids of all runs of a variant by their numbers, in order."""
        found: dict[int, int] = {}
        first = 0
        for block in self.blocks:
            place = variant - block.first_variant
            if 0 <= place < block.variants:
                begin = first + place * block.runs
                found |= {block.first_run + n: begin + n for n in range(block.runs)}
            first += block.size
        return dict(sorted(found.items()))

    def stretch_of(self, id_: int) -> int:
        """Index of the stretch, i.e. of runs that may all share a pack, that contains a run id.

        Raises:
            IndexError: there is no such run.
        """
        if not 0 <= id_ < self.total:
            raise IndexError(f"run {id_} of {self.total}")
        return bisect_right(self._stretch_starts, id_) - 1

    def stretches(self, run_ids: Iterable[int]) -> Iterator[list[int]]:
        """Run ids, which are sorted, by the stretch that they are in.

        Raises:
            IndexError: there is no such run.
        """
        return (list(stretch) for _, stretch in groupby(run_ids, self.stretch_of))

    def by_variants(self, run_ids: Iterable[int]) -> Iterator[list[int]]:
        """Run ids, which are sorted, by their variant, whichever block they are in.

        Raises:
            IndexError: there is no such run.
        """
        found: dict[int, list[int]] = {}
        for id_ in run_ids:
            found.setdefault(self.run(id_)[0], []).append(id_)
        return iter(found.values())

    def packed(self, run_ids: Iterable[int]) -> Iterator[list[int]]:
        """Run ids, which are sorted, in packs that are full, whichever ids are left out.

        Raises:
            IndexError: there is no such run.
        """
        size = self.runs_per_pack
        for stretch in self.stretches(run_ids):
            yield from (stretch[first : first + size] for first in range(0, len(stretch), size))

    def pack_of(self, id_: int) -> int:
        """Index of the pack that contains a run id.

        Raises:
            IndexError: there is no such run, or it is in no pack yet.
        """
        if not 0 <= id_ < self.in_packs:
            raise IndexError(f"run {id_} of {self.in_packs} in packs")
        at = bisect_right(self._segments, id_, key=lambda segment: segment.first_id) - 1
        segment = self._segments[at]
        return segment.first_pack + (id_ - segment.first_id) // segment.runs_per_pack

    def ids_of(self, packs: Sequence[Span]) -> list[Span]:
        """The run ids of spans of packs: consecutive packs have consecutive ids."""
        return [(self.pack(first)[0], self.pack(last)[-1]) for first, last in packs]

    @cached_property
    def _segments(self) -> list[_Segment]:
        segments: list[_Segment] = []
        pack = 0
        for first_id, size, runs_per_pack in self._cuts():
            segments.append(_Segment(first_id, size, pack, runs_per_pack))
            pack += segments[-1].packs
        return segments

    def _cuts(self) -> Iterator[tuple[int, int, int]]:
        """First id and number of runs that are cut together, and the size of their packs."""
        if self.rounds is None:
            yield from ((first, size, self.runs_per_pack) for first, size in self._stretches())
            return
        starts = self._stretch_starts
        for number, round_ in enumerate(self.rounds):
            first, last = self.of_round(number)
            low, high = bisect_right(starts, first), bisect_right(starts, last)
            for begin, end in pairwise([first, *starts[low:high], last + 1]):
                yield begin, end - begin, round_.size

    @cached_property
    def _stretch_starts(self) -> list[int]:
        return [first_id for first_id, _ in self._stretches()]

    def _stretches(self) -> Iterator[tuple[int, int]]:
        """First id and size of every stretch of runs that no break divides."""
        variants = max((b.first_variant + b.variants for b in self.blocks), default=0)
        cuts = list(ids(clip(parse_ranges(self.breaks), 0, variants)))
        first_id = 0
        for block in self.blocks:
            end = block.first_variant + block.variants
            inside = [cut for cut in cuts if block.first_variant < cut < end]
            starts = [block.first_variant, *inside, end]
            if self.by_variant:
                starts = list(range(block.first_variant, end + 1))
            for start, stop in pairwise(starts):
                size = (stop - start) * block.runs
                yield first_id, size
                first_id += size


class Entry(_Data):
    """A configuration entry of the document, and its variants."""

    name: str
    variants: PositiveInt
    digest: str | None = None
    """SHA-256 of the variants; None when not computed yet."""


def first_blocks(entries: Sequence[Entry], runs: int) -> tuple[Block, ...]:
    """The first block: all variants of all entries."""
    return (Block(first_variant=0, variants=sum(e.variants for e in entries), runs=runs),)


def format_breaks(indexes: Sequence[int]) -> str:
    """`PlanSpec.breaks` of variant indexes."""
    return format_ranges(spans(indexes))


def is_breaks(text: str, variants: int) -> bool:
    """Whether a text is a valid `PlanSpec.breaks` for this number of variants."""
    try:
        found = parse_ranges(text)
    except ValueError:
        return False
    return found == merge(found) and not subtract(found, [(1, variants - 1)])


class Bundle(_Data):
    """A `.tar.gz` of the document's folder in S3."""

    bucket: str
    key: str
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class GitSource(_Data):
    """A folder of a Git repository."""

    url: str
    ref: str
    path: str = ""


class Owner(_Data):
    """The Campaign that a bucket belongs to."""

    uid: str
    namespace: str
    name: str
    campaign: str
    """Name of the results folder."""

    def __str__(self) -> str:
        return f"the Campaign {self.namespace}/{self.name} (uid {self.uid})"


class CampaignPlan(_Data):
    """`campaign.json`: what a campaign's pods know about the campaign."""

    campaign: str
    """Name of the results folder."""
    bucket: str
    owner: Owner
    """The bucket's owner."""
    document: str
    """Name of the .vast file among the inputs; its text is stored beside it as `document.vast`."""
    expansion: Literal["pure", "composed", "proposed"]
    """`pure`: each pod expands the document. `composed`: pods read what the compose Job made.
    `proposed`: they read what Jobs of a search have proposed so far.
    """
    bundle: Bundle | None = None
    """Where the inputs are, unless they are in the mounted folder of files."""
    git: GitSource | None = None
    """Where the inputs are, unless they are in the mounted folder of files."""
    select: tuple[str, ...] = ()
    """Patterns of variant names; no pattern selects all."""
    reuse: bool = False
    """Whether runs are taken over from other campaigns, and offered to them."""
    runs: PositiveInt
    """Runs of every variant of the document."""
    seed: int
    """The campaign's seed."""
    image: str
    """The run image."""
    cluster: str | None = None
    """Cluster context for values that are given per cluster."""
    cpus: float | None = None
    """CPU limit of the main container [cores]."""
    memory: int | None = None
    """Memory limit of the main container [bytes]."""
    options: str = ""
    """Further options of scenario-execution, such as `-t -d`."""
    entries: tuple[Entry, ...] = ()
    """The document's variants by entry; empty until they are known."""
    inputs: dict[str, str] = Field(default_factory=dict)
    """SHA-256 of input files by path, for files that the operator has read."""
    composed: str | None = None
    """SHA-256 of the list of variants of a composed or proposed campaign; None before."""
    plan: PlanSpec | None = None
    """None in the plan of the compose Job, which computes it."""

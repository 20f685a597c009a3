"""The plan of a campaign on a cluster: which run is which, which runs share a pod.

It is small, whatever the number of runs, never changes an id that was given, and is shared by
the operator (how many pods?), the agent (which runs are mine?) and the command line.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
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
"""Most runs of a campaign: what is larger is a mistake, and no cluster could execute it."""


class _Data(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class Block(_Data):
    """Consecutive run ids: consecutive variants, each executed for the same run numbers.

    The runs of a variant stay together. Raising the number of runs appends a block, and so
    does a configuration that is added later.
    """

    first_variant: NonNegativeInt
    variants: PositiveInt
    first_run: NonNegativeInt = 0
    runs: PositiveInt

    @property
    def size(self) -> int:
        """Number of run ids."""
        return self.variants * self.runs


@dataclass(frozen=True, slots=True)
class _Segment:
    """Run ids that are cut into packs of one size, the last one perhaps smaller."""

    first_id: int
    size: int
    first_pack: int


class PlanSpec(_Data):
    """Blocks of run ids, cut into packs."""

    blocks: tuple[Block, ...]
    runs_per_job: PositiveInt = 1
    breaks: str = ""
    """Indexes of the variants that cannot share a pack with the one before, as ranges."""

    @field_validator("breaks")
    @classmethod
    def _check_breaks(cls, breaks: str) -> str:
        parse_ranges(breaks)
        return breaks

    @model_validator(mode="after")
    def _check_size(self) -> PlanSpec:
        if self.total > RUNS_LIMIT:
            raise ValueError(f"{self.total} runs are more than a campaign can have: {RUNS_LIMIT}")
        return self

    @cached_property
    def total(self) -> int:
        """Number of runs; their ids are 0 to `total` - 1."""
        return sum(block.size for block in self.blocks)

    @cached_property
    def packs(self) -> int:
        """Number of packs."""
        if not self._segments:
            return 0
        last = self._segments[-1]
        return last.first_pack + -(-last.size // self.runs_per_job)

    def pack(self, index: int) -> range:
        """The run ids of a pack.

        Raises:
            IndexError: there is no such pack.
        """
        if not 0 <= index < self.packs:
            raise IndexError(f"pack {index} of {self.packs}")
        at = bisect_right(self._segments, index, key=lambda segment: segment.first_pack) - 1
        segment = self._segments[at]
        first = (index - segment.first_pack) * self.runs_per_job
        last = min(first + self.runs_per_job, segment.size)
        return range(segment.first_id + first, segment.first_id + last)

    def run(self, id_: int) -> tuple[int, int]:
        """Index of the variant and number of the run (its results folder) of a run id.

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

    def stretch_of(self, id_: int) -> int:
        """The stretch of runs, which may share a pack all of them, that a run id is in.

        Raises:
            IndexError: there is no such run.
        """
        if not 0 <= id_ < self.total:
            raise IndexError(f"run {id_} of {self.total}")
        return bisect_right(self._segments, id_, key=lambda segment: segment.first_id) - 1

    def pack_of(self, id_: int) -> int:
        """The pack that a run id is in.

        Raises:
            IndexError: there is no such run.
        """
        segment = self._segments[self.stretch_of(id_)]
        return segment.first_pack + (id_ - segment.first_id) // self.runs_per_job

    def ids_of(self, packs: Sequence[Span]) -> list[Span]:
        """The run ids of spans of packs: consecutive packs have consecutive ids."""
        return [(self.pack(first)[0], self.pack(last)[-1]) for first, last in packs]

    @cached_property
    def _segments(self) -> list[_Segment]:
        segments: list[_Segment] = []
        for first_id, size in self._stretches():
            pack = 0
            if segments:
                before = segments[-1]
                pack = before.first_pack + -(-before.size // self.runs_per_job)
            segments.append(_Segment(first_id, size, pack))
        return segments

    def _stretches(self) -> Iterator[tuple[int, int]]:
        """First id and size of every stretch of runs that no break divides."""
        variants = max((b.first_variant + b.variants for b in self.blocks), default=0)
        cuts = list(ids(clip(parse_ranges(self.breaks), 0, variants)))
        first_id = 0
        for block in self.blocks:
            end = block.first_variant + block.variants
            inside = [cut for cut in cuts if block.first_variant < cut < end]
            starts = [block.first_variant, *inside, end]
            for start, stop in pairwise(starts):
                size = (stop - start) * block.runs
                yield first_id, size
                first_id += size


class Entry(_Data):
    """A configuration entry of the document, and the variants that it expands to."""

    name: str
    variants: PositiveInt
    digest: str | None = None
    """SHA-256 of them; None where nobody has seen them, and in plans of older versions."""


def first_blocks(entries: Sequence[Entry], runs: int) -> tuple[Block, ...]:
    """The block of a document's entries."""
    return (Block(first_variant=0, variants=sum(e.variants for e in entries), runs=runs),)


def format_breaks(indexes: Sequence[int]) -> str:
    """`PlanSpec.breaks` of variant indexes."""
    return format_ranges(spans(indexes))


def is_breaks(text: str, variants: int) -> bool:
    """Whether a text can be `PlanSpec.breaks` of so many variants."""
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
    """`campaign.json`: what the pods of a campaign know about it."""

    campaign: str
    """Name of the results folder."""
    bucket: str
    owner: Owner | None = None
    """Whose the bucket is; older plans do not say it."""
    endpoint: str
    """URL of the S3 server as pods reach it."""
    region: str | None = None
    document: str
    """File name of the .vast document among the inputs; its text is `document.vast` beside."""
    expansion: Literal["pure", "composed"]
    """Whether a pod expands the document itself, or reads what the compose Job left."""
    bundle: Bundle | None = None
    """Where the inputs are, when not in the mounted folder of files."""
    git: GitSource | None = None
    """Where the inputs are, when not in the mounted folder of files."""
    select: tuple[str, ...] = ()
    """Patterns of variant names; no pattern selects all."""
    runs: PositiveInt
    """Runs of every variant of the document."""
    image: str
    """The run image."""
    cluster: str | None = None
    """Name for values that are given per cluster."""
    cpus: float | None = None
    """CPU limit of the main container [cores]."""
    memory: int | None = None
    """Memory limit of the main container [bytes]."""
    options: str = ""
    """Further options of the scenario execution, as `-t -d`."""
    entries: tuple[Entry, ...] = ()
    """What the document expands to; empty until it is known."""
    inputs: dict[str, str] = Field(default_factory=dict)
    """SHA-256 of input files by path, of those that the operator has seen."""
    composed: str | None = None
    """SHA-256 of the list of variants that the compose Job stored; None in plans of older
    versions."""
    plan: PlanSpec | None = None
    """None in the plan of the compose Job, which finds it out."""

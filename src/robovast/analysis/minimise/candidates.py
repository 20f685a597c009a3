"""What could be milder about a failing configuration: towards those that pass, or the defaults."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from robovast.analysis.minimise.shrinking import Items, Ladder, Parameters
from robovast.campaign.configurations import read_variants
from robovast.campaign.layout import Layout
from robovast.campaign.run_record import read_run_record
from robovast.campaign.verdict import Verdict
from robovast.model.expansion import Variant

STEPS = 16
"""Steps between a mild number and the failing one; whole numbers that are closer have fewer."""
_LARGEST = 1e300
"""Numbers above cannot be divided as decimals."""

Choice = bool | str


def reductions_of(
    variant: Variant, passing: Sequence[Variant], defaults: Mapping[str, Any]
) -> list[Items | Ladder]:
    """What can be left out or made milder: lists, then choices, then numbers.

    The mildest value is that of the configuration which passes and has another one, and of such
    the one that is most like this one; else the scenario's default. Poses and other structures
    stay as they are, and so do texts that name files of a configuration.

    Args:
        variant: a configuration that fails.
        passing: others of its campaign that do not.
        defaults: of the scenario's parameters.
    """
    own = variant.parameters
    nearest = sorted(passing, key=lambda other: (_distance(own, other.parameters), other.name))
    files = [file.name for one in (variant, *nearest) for file in one.files]
    known = [*({**defaults, **other.parameters} for other in nearest), defaults]
    lists = [Items(name) for name, value in own.items() if isinstance(value, list) and value]
    choices: list[Ladder] = []
    numbers: list[Ladder] = []
    for name, value in own.items():
        others = [parameters[name] for parameters in known if name in parameters]
        if _is_number(value):
            numbers += _ladders(name, value, filter(_is_number, others))
        elif isinstance(value, Choice) and value not in files:
            alike = [other for other in others if type(other) is type(value)]
            mildest = next((o for o in alike if o != value and o not in files), None)
            choices += [] if mildest is None else [Ladder(name, (mildest, value))]
    return [*lists, *choices, *numbers]


def passing_variants(layout: Layout) -> list[Variant]:
    """The configurations of a campaign that passed in some run, and failed in none."""
    return [
        variant for variant in read_variants(layout) if _passes(_verdicts(layout, variant.name))
    ]


def _passes(verdicts: Iterator[Verdict]) -> bool:
    found = False
    for verdict in verdicts:
        if verdict is Verdict.FAILED:
            return False
        found = found or verdict is Verdict.PASSED
    return found


def _verdicts(layout: Layout, variant: str) -> Iterator[Verdict]:
    folders = layout.run_folders_of(variant) if os.path.isdir(layout.variant(variant)) else ()
    records = map(read_run_record, folders)
    return (record.verdict for record in records if record is not None)


def _distance(own: Parameters, other: Parameters) -> tuple[int, float]:
    """How many parameters differ, and by how much the numbers among them."""
    names = [n for n in {**own, **other} if own.get(n) != other.get(n)]
    both = ((own[name], other[name]) for name in names if name in own and name in other)
    numbers = [(a, b) for a, b in both if _is_number(a) and _is_number(b)]
    return len(names), sum(abs(a - b) / (abs(a) + abs(b)) for a, b in numbers)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and type(value) is not bool and abs(value) < _LARGEST


def _ladders(name: str, value: float, others: Iterable[Any]) -> Iterator[Ladder]:
    mildest = next((other for other in others if other != value), None)
    if mildest is not None:
        yield Ladder(name, tuple(dict.fromkeys(_between(mildest, value))))


def _between(mildest: float, value: float) -> Iterator[float]:
    """Numbers from one to another, in equal steps."""
    if isinstance(mildest, int) and isinstance(value, int):
        steps, gap = min(STEPS, abs(value - mildest)), value - mildest
        yield from (mildest + gap * step // steps for step in range(steps + 1))
        return
    yield mildest
    if step := (value - mildest) / STEPS:
        digits = 2 - math.floor(math.log10(abs(step)))
        yield from (round(mildest + number * step, digits) for number in range(1, STEPS))
    yield value

"""Plans from the messages of the propose Jobs of a search. Pure functions.

Users' plugins may have influenced every word.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

from robovast.base.ranges import clip, format_ranges, merge, parse_ranges, shift
from robovast.kubeapi.pod_contract.messages import Proposed
from robovast.kubeapi.status import SearchStatus
from robovast.model.packs import RUNS_LIMIT, Block, Entry, PlanSpec
from robovast_operator.kube.sentences import clause
from robovast_operator.planning.accept import failed_task
from robovast_operator.planning.campaign import Accepted, Rejected, Revision

ENTRY = "search"
"""Name of the only entry of a search's plan; its variants are those that were proposed."""

_PLAN_LIMIT = 600_000
"""Longest plan [byte]: with the document it must fit into a ConfigMap, which may have 1 MiB."""


def grown(
    accepted: Accepted, revisions: Sequence[Revision], proposed: Proposed, name: str, limit: int
) -> Revision:
    """Return the plan with the runs that a propose Job asks for.

    Args:
        accepted: the campaign.
        revisions: the plans so far, oldest first.
        proposed: message of the Job's pod.
        name: of the new plan's ConfigMap.
        limit: most variants of a document.

    Raises:
        ValueError: it asks for something that makes no plan.
    """
    newest = revisions[-1] if revisions else None
    planned = newest.entries[0].variants if newest else 0
    before = newest.plan.blocks if newest else ()
    variants = planned + proposed.variants
    if not proposed.digest:
        raise ValueError("the list of configurations has no digest")
    if variants > limit:
        raise ValueError(f"there are {variants:,} configurations, more than {limit:,}")
    keys = ("first_variant", "variants", "first_run", "runs")
    more = [Block(**dict(zip(keys, given, strict=True))) for given in proposed.blocks]
    _check_order(before, more, variants)
    _check_awaited(newest.plan if newest else None, more, proposed.awaited)
    plan = PlanSpec(
        blocks=(*before, *more),
        awaited=proposed.awaited,
        runs_per_job=accepted.vast.execution.runs_per_start,
        breaks=_breaks(newest.plan.breaks if newest else "", planned, proposed),
    )
    if len(plan.model_dump_json()) > _PLAN_LIMIT:
        raise ValueError(f"{len(plan.blocks):,} blocks of runs are too large for a ConfigMap")
    text = newest.document if newest else accepted.document_text
    entries = (Entry(name=ENTRY, variants=variants),)
    number = newest.number + 1 if newest else 0
    return Revision(number, name, plan, entries, {}, text, proposed.digest)


def first_plan(
    accepted: Accepted, proposed: Proposed | str | None, name: str, limit: int, reason: str
) -> Revision | Rejected:
    """Return the first plan of a search, or the rejection.

    Args:
        accepted: the campaign.
        proposed: message of the first propose Job's pod.
        name: of the plan's ConfigMap.
        limit: most variants of a document.
        reason: why the Job failed, in one word.
    """
    if not isinstance(proposed, Proposed):
        return failed_task("search", proposed, reason)
    if proposed.stop:
        message = (
            f"The search ended before the first run: {clause(proposed.stop_reason)}. Check "
            "`search` in the .vast file."
        )
        return Rejected("NothingProposed", message)
    try:
        return grown(accepted, (), proposed, name, limit)
    except ValueError as error:
        return Rejected("InvalidPlan", no_plan(error))


def no_plan(why: object) -> str:
    """Return the message about a propose Job that returned an invalid plan."""
    return f"The search Job proposed invalid runs: {why}. Check the search strategy."


def _check_order(before: Sequence[Block], more: Sequence[Block], variants: int) -> None:
    """Check that each run is planned once, and that runs of a variant are numbered from 0.

    Raises:
        ValueError: they are not, or there are too many.
    """
    if sum(block.size for block in (*before, *more)) > RUNS_LIMIT:
        raise ValueError(f"the campaign would have more than {RUNS_LIMIT:,} runs")
    planned: list[Block] = list(before)
    for block in more:
        last = block.first_variant + block.variants
        if last > variants:
            raise ValueError(f"runs of configuration {last - 1} of {variants} are requested")
        if any(runs != block.first_run for runs in _planned(planned, block)):
            raise ValueError(f"the runs from {block.first_run} on are not the next runs")
        planned.append(block)


def _check_awaited(before: PlanSpec | None, more: Sequence[Block], awaited: int | None) -> None:
    """Check that the search awaits at least one new run.

    Raises:
        ValueError: nothing is, or what is not planned.
    """
    planned = len(before.blocks) if before else 0
    ended = len(before.awaited_blocks) if before else 0
    blocks = planned + len(more)
    wanted = blocks if awaited is None else awaited
    if not ended <= wanted <= blocks:
        raise ValueError(f"{wanted} awaited blocks of runs are not between {ended} and {blocks}")
    if not more and wanted == ended:
        raise ValueError("no runs are requested, and the search has not ended")


def _planned(blocks: Sequence[Block], wanted: Block) -> set[int]:
    """Return the numbers of planned runs of the variants of a block."""
    first, size = wanted.first_variant, wanted.variants
    changes = [0] * (size + 1)
    for block in blocks:
        begin = max(block.first_variant - first, 0)
        end = min(block.first_variant + block.variants - first, size)
        if begin < end:
            changes[begin] += block.runs
            changes[end] -= block.runs
    return set(list(accumulate(changes))[:-1])


def _breaks(before: str, planned: int, proposed: Proposed) -> str:
    """Return the breaks of a plan with further variants, none of which is in an earlier pack.

    Raises:
        ValueError: they are none.
    """
    new = clip(merge(parse_ranges(proposed.breaks)), 0 if planned else 1, proposed.variants - 1)
    return format_ranges([*parse_ranges(before), *shift(new, planned)])


def search_status(proposed: Proposed, plan: str) -> SearchStatus:
    """Return the progress of a search, as reported by the last propose Job that read a plan."""
    names = SearchStatus.model_fields.keys() - {"plan"}
    return SearchStatus(plan=plan, **{name: getattr(proposed, name) for name in names})

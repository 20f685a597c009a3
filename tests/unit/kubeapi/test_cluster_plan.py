"""The plan of a campaign on a cluster."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.base.ranges import (
    count,
    format_ranges,
    ids,
    merge,
    parse_ranges,
    spans,
    subtract,
    truncate,
)
from robovast.model.packs import Block, PlanSpec, format_breaks
from robovast.model.plan import breaks, pack_runs, plan_runs, plan_variants
from robovast.model.repetition import GroupSizes, retry_groups
from robovast.model.variant import ConfigFile, Variant


@st.composite
def plans(draw: st.DrawFn) -> PlanSpec:
    variants = draw(st.integers(1, 12))
    runs = draw(st.integers(1, 5))
    blocks = [Block(first_variant=0, variants=variants, runs=runs)]
    if draw(st.booleans()):
        more = draw(st.integers(1, 4))
        blocks.append(Block(first_variant=0, variants=variants, first_run=runs, runs=more))
    if draw(st.booleans()):
        added = draw(st.integers(1, 4))
        blocks.append(Block(first_variant=variants, variants=added, runs=runs))
        variants += added
    cuts = draw(st.sets(st.integers(1, variants)))
    return PlanSpec(
        blocks=tuple(blocks),
        runs_per_job=draw(st.integers(1, 7)),
        breaks=format_breaks(sorted(cuts)),
        by_variant=draw(st.booleans()),
    )


@given(plans())
def test_runs_that_decide_together_are_one_pack_of_each_block(plan: PlanSpec) -> None:
    plan = plan.model_copy(update={"by_variant": True})
    packs = [[plan.run(id_) for id_ in plan.pack(pack)] for pack in range(plan.packs)]
    assert all(len({variant for variant, _ in pack}) == 1 for pack in packs)
    assert len(packs) == sum(block.variants for block in plan.blocks)
    for variant in {variant for pack in packs for variant, _ in pack}:
        ids = plan.numbers_of(variant)
        assert [plan.run(id_) for id_ in ids.values()] == [(variant, number) for number in ids]
        assert len(ids) == sum(len(pack) for pack in packs if pack[0][0] == variant)


@given(plans())
def test_every_run_is_in_exactly_one_pack_in_order(plan: PlanSpec) -> None:
    packed = [id_ for pack in range(plan.packs) for id_ in plan.pack(pack)]
    assert packed == list(range(plan.total))
    assert all(id_ in plan.pack(plan.pack_of(id_)) for id_ in range(plan.total))
    assert len({plan.run(id_) for id_ in range(plan.total)}) == plan.total


@given(plans(), st.integers(1, 9))
def test_what_is_appended_leaves_earlier_ids_and_packs_as_they_were(
    plan: PlanSpec, runs: int
) -> None:
    block = Block(first_variant=0, variants=3, first_run=1000, runs=runs)
    longer = plan.model_copy(update={"blocks": (*plan.blocks, block)})
    longer = PlanSpec.model_validate(longer.model_dump())
    assert [longer.pack(p) for p in range(plan.packs)] == [plan.pack(p) for p in range(plan.packs)]
    assert [longer.run(i) for i in range(plan.total)] == [plan.run(i) for i in range(plan.total)]
    assert longer.total == plan.total + 3 * runs


@given(st.lists(st.integers(0, 3), min_size=1, max_size=9), st.integers(1, 4), st.integers(1, 6))
def test_a_cluster_packs_runs_as_a_laptop_does(maps: list[int], runs: int, size: int) -> None:
    variants = [
        Variant(f"v-{i}", "v", {}, (ConfigFile("map.yaml", Path(f"/maps/{m}")),) if m else ())
        for i, m in enumerate(maps)
    ]
    plan = plan_variants(variants, runs, size)
    local = pack_runs(plan, plan_runs(plan, variants))
    assert [[run.id for run in job.runs] for job in local] == [
        list(plan.pack(index)) for index in range(plan.packs)
    ]
    assert [(variants.index(run.variant), run.number) for job in local for run in job.runs] == [
        plan.run(id_) for id_ in range(plan.total)
    ]


def test_a_plan_of_a_hundred_thousand_runs_is_small() -> None:
    plan = PlanSpec(blocks=(Block(first_variant=0, variants=1000, runs=100),), runs_per_job=20)
    assert len(plan.model_dump_json()) < 200
    assert (plan.packs, plan.pack(4999)[-1], plan.run(99_999)) == (5000, 99_999, (999, 99))


@pytest.mark.parametrize("index", [-1, 3])
def test_there_is_no_pack_and_no_run_outside_the_plan(index: int) -> None:
    plan = PlanSpec(blocks=(Block(first_variant=0, variants=3, runs=1),))
    with pytest.raises(IndexError):
        plan.pack(index)
    with pytest.raises(IndexError):
        plan.run(index)
    with pytest.raises(IndexError):
        plan.pack_of(index)


numbers = st.sets(st.integers(0, 60))


@given(numbers, numbers)
def test_ranges_are_sets_of_ids(some: set[int], others: set[int]) -> None:
    assert set(ids(spans(some))) == some
    assert count(spans(some)) == len(some)
    assert parse_ranges(format_ranges(spans(some))) == spans(some)
    assert set(ids(merge([*spans(some), *spans(others)]))) == some | others
    assert set(ids(subtract(spans(some), spans(others)))) == some - others


@pytest.mark.parametrize("text", ["a", "3-", "5-3", "1,,2", "-1"])
def test_what_is_no_range_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="range"):
        parse_ranges(text)


@given(numbers, st.integers(0, 40))
def test_truncated_ranges_are_ranges_of_the_beginning(some: set[int], limit: int) -> None:
    text = format_ranges(spans(some))
    short, cut = truncate(text, limit)
    assert len(short) <= limit or not cut
    assert cut == (short != text)
    assert text.startswith(short)
    assert set(ids(parse_ranges(short))) <= some


@given(plans(), st.data())
def test_bad_runs_are_repeated_exactly_in_groups_that_few_sizes_tell(
    plan: PlanSpec, data: st.DataObject
) -> None:
    chosen = data.draw(st.sets(st.integers(0, plan.total - 1)))
    groups = retry_groups(plan, spans(chosen))
    assert sorted(id_ for group in groups for id_ in group) == sorted(chosen)
    kin = (lambda id_: plan.run(id_)[0]) if plan.by_variant else plan.stretch_of
    assert all(len({kin(id_) for id_ in group}) == 1 for group in groups)
    assert all(len(group) <= plan.runs_per_pack for group in groups)
    sizes = GroupSizes.parse(str(GroupSizes.of(groups)))
    assert (sizes.groups, sizes.runs) == (len(groups), len(chosen))
    few = 64 if plan.by_variant else 2 + min(plan.runs_per_pack, 9).bit_length()
    assert len(sizes.parts) <= few
    some = data.draw(st.sets(st.integers(0, max(0, len(groups) - 1)))) if groups else set()
    assert sizes.runs_of(spans(some)) == sum(len(groups[number]) for number in some)


def test_bad_runs_of_a_variant_that_decide_together_are_one_group() -> None:
    """Two pods would not see each other's verdicts, and one execute what is not needed."""
    blocks = (
        Block(first_variant=0, variants=2, runs=40),
        Block(first_variant=0, variants=2, first_run=40, runs=30),
    )
    plan = PlanSpec(blocks=blocks, by_variant=True)
    groups = retry_groups(plan, [(5, 27), (80, 104), (110, 139)])
    variants = [[plan.run(id_)[0] for id_ in group] for group in groups]
    assert [(v[0], len(v)) for v in variants] == [(0, 48), (1, 30)]


def test_few_sizes_tell_the_groups_of_variants_that_have_thousands_of_runs() -> None:
    plan = PlanSpec(blocks=(Block(first_variant=0, variants=900, runs=2000),), by_variant=True)
    bad = [(2000 * n, 2000 * n + n) for n in range(900)]
    groups = retry_groups(plan, bad)
    assert len(str(GroupSizes.of(groups))) < 2000
    assert len(groups[0]) > 870


def test_variants_that_bring_copies_of_one_file_share_a_job(tmp_path: Path) -> None:
    maps = []
    for index, content in enumerate(["one", "one", "two"]):
        path = tmp_path / str(index) / "map.yaml"
        path.parent.mkdir()
        path.write_text(content)
        maps.append(path)
    variants = [
        Variant(f"v-{i}", "v", {}, (ConfigFile("map.yaml", path),)) for i, path in enumerate(maps)
    ]
    assert breaks(variants) == [2]

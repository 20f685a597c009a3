"""Namespaces take turns, in the queue of Campaigns as in that of expansions."""

from __future__ import annotations

import asyncio
from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from robovast_operator.kube.objects import Key
from robovast_operator.kube.rotation import Rotation
from robovast_operator.kube.work_queue import SHARE, WORKERS, WorkQueue, work

SPACES = st.sampled_from("abcd")
STEPS = st.lists(st.one_of(SPACES, st.none(), st.frozensets(SPACES)), max_size=60)
"""A namespace that gets an item, or an item is taken: of any namespace, or only of some."""


@given(STEPS)
def test_each_item_is_taken_once_in_order_and_no_namespace_waits_for_two_of_another(
    steps: list[str | frozenset[str] | None],
) -> None:
    rotation: Rotation[tuple[str, int]] = Rotation()
    waiting: dict[str, list[int]] = {space: [] for space in "abcd"}
    passed: dict[str, Counter[str]] = {space: Counter() for space in "abcd"}
    for number, step in enumerate([*steps, *[None] * len(steps)]):
        if isinstance(step, str):
            rotation.add(step, (step, number))
            waiting[step].append(number)
            continue
        allowed = frozenset("abcd") if step is None else step
        item = rotation.take(allowed.__contains__)
        ready = {space for space in allowed if waiting[space]}
        assert (item is None) == (not ready)
        if item is None:
            continue
        space, first = item
        assert space in ready
        assert waiting[space].pop(0) == first
        passed[space].clear()
        for other in ready - {space}:
            passed[other][space] += 1
            if step is None and all(isinstance(s, str) or s is None for s in steps):
                assert passed[other][space] <= 1, "a namespace got two turns before another one"
    assert not any(waiting.values())


def test_who_comes_during_a_turn_is_next() -> None:
    rotation: Rotation[str] = Rotation()
    for item in ("first", "second"):
        rotation.add("many", item)
    assert rotation.take() == "first"
    rotation.add("few", "one")
    assert [rotation.take(), rotation.take(), rotation.take()] == ["one", "second", None]


@given(st.integers(1, 200), st.integers(1, 3))
def test_a_campaign_waits_for_few_of_another_namespace(many: int, others: int) -> None:
    """Its turn comes after one Campaign of each other namespace, however many those have."""

    async def scenario() -> list[Key]:
        queue, seen = WorkQueue(), []
        for number in range(many):
            for other in range(others):
                queue.add((f"many-{other}", str(number)))
        queue.add(("few", "one"))
        while ("few", "one") not in seen:
            async with asyncio.timeout(60):
                seen.append(key := await queue.take())
            queue.done(key)
        return seen

    assert len(asyncio.run(scenario())) <= others + 1


def test_a_namespace_whose_server_does_not_answer_leaves_workers_to_others() -> None:
    async def scenario() -> tuple[int, list[Key]]:
        queue, stuck, seen = WorkQueue(), 0, []

        async def look(key: Key) -> None:
            nonlocal stuck
            seen.append(key)
            if key[0] == "stuck":
                stuck += 1
                await asyncio.sleep(600)

        for number in range(3 * WORKERS):
            queue.add(("stuck", str(number)))
        tasks = [asyncio.create_task(work(queue, look)) for _ in range(WORKERS)]
        await asyncio.sleep(0.1)
        queue.add(("well", "one"))
        async with asyncio.timeout(60):
            while ("well", "one") not in seen:
                await asyncio.sleep(0.01)
        for task in tasks:
            task.cancel()
        return stuck, seen

    stuck, _ = asyncio.run(scenario())
    assert stuck == SHARE

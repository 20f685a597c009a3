"""The queue of a campaign that grows: workers wait for runs, until it is closed."""

from __future__ import annotations

from threading import Thread

from robovast.execution.local.pack_queue import GrowingQueue
from robovast.model.expansion import Variant
from robovast.model.packs import Block, PlanSpec
from robovast.model.plan import PackStart, Run, block_runs


def grown(runs: int) -> tuple[PlanSpec, list[Run]]:
    block = Block(first_variant=0, variants=1, first_run=0, runs=runs)
    plan = PlanSpec(blocks=(block,))
    return plan, block_runs(plan, block, [Variant("one", "one", {})], None)


def test_a_worker_waits_for_runs_and_leaves_when_the_queue_is_closed() -> None:
    queue = GrowingQueue(PlanSpec(blocks=()), 0)
    taken: list[PackStart | None] = []

    def work() -> None:
        while (pack := queue.take()) is not None:
            taken.append(pack)
            if len(taken) == 1:
                queue.put_back(pack.runs)

    worker = Thread(target=work)
    worker.start()
    worker.join(0.05)
    assert worker.is_alive(), "it leaves although further runs may come"
    assert queue.reserve(5) == 0
    queue.add(*grown(2))
    while len(taken) < 3:
        worker.join(0.01)
    queue.close()
    worker.join(10)
    assert not worker.is_alive()
    numbers = [(pack.index, [run.id for run in pack.runs]) for pack in taken if pack]
    assert numbers == [(5, [0]), (6, [1]), (7, [0])]

"""How often a campaign ends within the interval of its estimate, over simulated campaigns.

    python tests/bench/estimates.py

The campaigns of a kind differ as those of a shared cluster do: each has another load of the nodes.
Before each campaign its time is estimated from the earlier ones of its kind; while it goes on, from
its own pace. The goal is that the interval holds in 90 of 100 cases.
"""

from __future__ import annotations

import argparse
import heapq
import random
from collections.abc import Callable
from statistics import median

from robovast.model.estimate import Forecast, Spent, forecast, remaining

KINDS: dict[str, Callable[[random.Random], float]] = {
    "equal": lambda _: 30.0,
    "uniform": lambda dice: dice.uniform(5, 60),
    "half are short": lambda dice: dice.choice((3.0, 60.0)),
    "exponential": lambda dice: dice.expovariate(1 / 30),
}
SHAPES = ((20, 4), (200, 10), (2000, 50))
LOAD = 0.2
"""How much campaigns of one kind differ (deviation of the logarithm)."""
START = 2.0
"""A pod's start [s]."""


def ends_of(times: list[float], workers: int) -> list[float]:
    """When the runs of a campaign end, in order."""
    free = [0.0] * workers
    ends = []
    for time in times:
        ends.append(heapq.heappop(free) + START + time)
        heapq.heappush(free, ends[-1])
    return sorted(ends)


def holds(found: Forecast, took: float) -> bool:
    """Whether an interval holds."""
    return found.least <= took <= found.most


def main() -> None:
    """Print how often intervals hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--campaigns", type=int, default=20, help="of each kind and size")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    dice = random.Random(given.seed)  # noqa: S311
    before: list[tuple[bool, float]] = []
    under_way: dict[int, list[tuple[bool, float]]] = {10: [], 30: [], 60: [], 90: []}
    for kind in KINDS.values():
        for runs, workers in SHAPES:
            earlier: list[Spent] = []
            for _ in range(given.campaigns + 1):
                load = dice.lognormvariate(0, LOAD)
                ends = ends_of([load * kind(dice) for _ in range(runs)], workers)
                found = forecast(earlier, runs, workers)
                if found is not None:
                    before.append((holds(found, ends[-1]), abs(found.seconds / ends[-1] - 1)))
                earlier.append(Spent(runs, workers, ends[-1]))
                for percent, cases in under_way.items():
                    done = runs * percent // 100
                    so_far = remaining(done, runs - done, workers, ends[done - 1])
                    assert so_far is not None
                    left = ends[-1] - ends[done - 1]
                    error = abs(so_far.seconds - left) / ends[-1]
                    cases.append((holds(so_far, left), error))
    print("| estimated | campaigns | interval holds | median error |")
    print("| --- | --- | --- | --- |")
    rows = {"before": before} | {f"at {p} % of its runs": c for p, c in under_way.items()}
    for name, cases in rows.items():
        share = sum(held for held, _ in cases) / len(cases)
        error = median(error for _, error in cases)
        print(f"| {name} | {len(cases)} | {share:.0%} | {error:.0%} |")


if __name__ == "__main__":
    main()

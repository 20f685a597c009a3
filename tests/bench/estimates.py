"""How often a campaign ends within the interval of its estimate.

    python tests/bench/estimates.py [--executed FILE]

Campaigns are simulated, or executed here as plain processes and noted in a file, which is read
first, so that the same campaigns can be judged anew. Those of a kind are estimated from the earlier
ones of it before they begin, and from their own pace while they go on. Of the simulated ones each
has another load of the nodes, as in a shared cluster, and the runs of a pack are known when it
ends; those executed have the load of the machine, and another number of runs each. The goal is that
the interval holds in 90 of 100 cases.
"""

from __future__ import annotations

import argparse
import heapq
import json
import os
import random
import sys
import time
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from itertools import count
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

from support.campaigns.local import DOCUMENT, Recorder, make_campaign, run  # noqa: E402

from robovast.model.estimate import (  # noqa: E402
    CampaignProgress,
    Forecast,
    Spent,
    forecast,
    remaining,
)
from robovast.model.packing import PackSample, next_packs, pace_of  # noqa: E402
from robovast.model.plan import Run  # noqa: E402

KINDS: dict[str, Callable[[random.Random], float]] = {
    "equal": lambda _: 30.0,
    "uniform": lambda dice: dice.uniform(5, 60),
    "half are short": lambda dice: dice.choice((3.0, 60.0)),
    "exponential": lambda dice: dice.expovariate(1 / 30),
}
SHAPES = ((20, 4, 1), (200, 10, 1), (2000, 50, 1), (2000, 50, 20), (200, 10, 0), (2000, 50, 0))
"""Runs, workers and runs of a pack; 0 is as many as measured."""
LOAD = 0.2
"""How much campaigns of one kind differ (deviation of the logarithm)."""
START = 2.0
"""A pod's start [s]."""
PERCENT = (10, 30, 60, 90)

EXECUTED = ((20, 4), (40, 4), (60, 4))
"""Runs and workers of executed campaigns, one of these at random each time."""
FASTER = 20
"""By how much their runs are shorter than the simulated ones."""
WORK = """\
import sys, time

quarter = int(sys.argv[1]) / 4000
time.sleep(3 * quarter)
while time.process_time() < quarter:
    pass
"""
"""A run: a quarter of its time a CPU is busy, so that it takes longer beside other work."""


@dataclass(frozen=True)
class Pack:
    """One that has ended."""

    begin: float
    took: PackSample

    @property
    def end(self) -> float:
        """When it did."""
        return self.begin + self.took.seconds


@dataclass(frozen=True)
class Campaign:
    """How one went."""

    kind: str
    """Its kind, and its shape where all have the same."""
    runs: int
    workers: int
    ends: list[float]
    """When its runs ended, in order, since it began [s]."""
    seconds: float
    """What all of it took."""
    load: float = 0.0
    """Of the machine at its end."""
    packs: tuple[Pack, ...] = ()
    """In the order of their ends; none where runs end one by one."""
    measured: bool = False
    """Whether they are as large as measured."""

    def at(self, percent: int) -> tuple[float, CampaignProgress]:
        """When so many of its runs had ended, and how far it was then."""
        now = self.ends[self.runs * percent // 100 - 1]
        done = bisect_right(self.ends, now)
        left = self.runs - done
        if not self.packs:
            return now, CampaignProgress(done, left, min(left, self.workers), self.workers, now)
        ended = [pack for pack in self.packs if pack.end <= now]
        active = [pack for pack in self.packs if pack.begin <= now < pack.end]
        begun = sum(pack.took.runs for pack in active)
        if not self.measured:
            size = self.runs / len(self.packs)
            return now, CampaignProgress(done, left, begun, self.workers, now, size)
        pace, workers = pace_of(pack.took for pack in ended), self.workers
        assert pace is not None
        packs = len(ended) + len(active)
        starts = max(0.0, min(pace.start * packs / workers, now - pace.run * done / workers))
        return now, CampaignProgress(done, left, begun, workers, now, starts=starts)


def simulated(number: int, dice: random.Random) -> Iterable[Campaign]:
    """So many campaigns of each kind and shape, and one that is known before."""
    for name, kind in KINDS.items():
        for runs, workers, size in SHAPES:
            for _ in range(number + 1):
                load = dice.lognormvariate(0, LOAD)
                packs = _simulate([load * kind(dice) for _ in range(runs)], workers, size)
                ends = [pack.end for pack in packs for _ in range(pack.took.runs)]
                yield Campaign(
                    kind=f"{name}, {runs} runs by {size}",
                    runs=runs,
                    workers=workers,
                    ends=ends,
                    seconds=ends[-1],
                    packs=tuple(packs),
                    measured=size == 0,
                )


def _simulate(times: list[float], workers: int, size: int) -> list[Pack]:
    """The packs of a campaign whose runs take so long, in the order of their ends."""
    left, last, now = list(times), size, 0.0
    cut: list[list[float]] = []
    active: list[tuple[float, int, Pack]] = []
    ended: list[Pack] = []
    for number in count():
        if not cut and left and (size or not active or 2 * len(ended) >= workers):
            planned = len(left)
            if not size:
                pace = pace_of(pack.took for pack in ended)
                planned, last = next_packs(planned, workers, last, pace)
            cut = [left[at : min(at + last, planned)] for at in range(0, planned, last)]
            left = left[planned:]
        if cut and len(active) < workers:
            runs = cut.pop(0)
            pack = Pack(now, PackSample(len(runs), sum(runs), START + sum(runs)))
            heapq.heappush(active, (pack.end, number, pack))
        elif active:
            now, _, over = heapq.heappop(active)
            ended.append(over)
        else:
            break
    return ended


def executed(number: int, dice: random.Random) -> Iterable[Campaign]:
    """So many campaigns in all, of each kind in turn, and one of each that is known before."""
    for index in range(number + len(KINDS)):
        name = list(KINDS)[index % len(KINDS)]
        runs, workers = dice.choice(EXECUTED)
        times = [round(1000 * KINDS[name](dice) / FASTER) for _ in range(runs)]
        yield _execute(name, times, workers)


def _execute(kind: str, times: list[int], workers: int) -> Campaign:
    ends: list[float] = []

    def note(_: Run) -> None:
        ends.append(time.monotonic() - begin)

    with TemporaryDirectory() as folder:
        document = DOCUMENT.replace("[1, 2, 3]", json.dumps(times))
        packs, python = "  runs_per_job: auto\n", sys.executable
        path = make_campaign(Path(folder) / "in", WORK, packs, document, python)
        begin = time.monotonic()
        summary = run(path, Path(folder) / "out", Recorder(on_finished=note), jobs=workers)
        seconds = time.monotonic() - begin
    verdicts = {record.verdict for record in summary.records}
    assert verdicts == {"passed"}, verdicts
    return Campaign(kind, len(times), workers, ends, seconds, os.getloadavg()[0])


def known(file: Path) -> list[Campaign]:
    """Campaigns that were executed before."""
    lines = file.read_text().splitlines() if file.exists() else []
    return [Campaign(**json.loads(line)) for line in lines]


@dataclass(frozen=True)
class Case:
    """One estimate, and what it was of."""

    found: Forecast
    took: float
    of: float
    """What the whole campaign took [s]."""

    @property
    def holds(self) -> bool:
        """Whether its interval does."""
        return self.found.least <= self.took <= self.found.most

    @property
    def error(self) -> float:
        """As a part of the whole campaign."""
        return abs(self.found.seconds - self.took) / self.of


def judge(campaigns: Iterable[Campaign]) -> dict[str, list[Case]]:
    """All estimates of campaigns, by when they were made."""
    earlier: dict[str, list[Spent]] = defaultdict(list)
    rows: dict[str, list[Case]] = {"before": []}
    rows |= {f"at {percent} % of its runs": [] for percent in PERCENT}
    for one in campaigns:
        found = forecast(earlier[one.kind], one.runs, one.workers)
        if found is not None:
            rows["before"].append(Case(found, one.seconds, one.seconds))
        earlier[one.kind].append(Spent(one.runs, one.workers, one.seconds))
        for percent in PERCENT:
            now, progress = one.at(percent)
            so_far = remaining(progress)
            assert so_far is not None
            left = one.ends[-1] - now
            rows[f"at {percent} % of its runs"].append(Case(so_far, left, one.ends[-1]))
    return rows


def main() -> None:
    """Print how often intervals hold."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "--campaigns", type=int, default=20, help="of each kind and size, or in all"
    )
    parser.add_argument("--executed", type=Path, help="file with executed campaigns")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    dice = random.Random(given.seed)  # noqa: S311
    if given.executed is None:
        campaigns = list(simulated(given.campaigns, dice))
    else:
        campaigns = known(given.executed)
        for one in () if campaigns else executed(given.campaigns, dice):
            campaigns.append(one)
            with given.executed.open("a") as stream:
                stream.write(json.dumps(asdict(one)) + "\n")
    print("| estimated | campaigns | interval holds | median error |")
    print("| --- | --- | --- | --- |")
    for name, cases in judge(campaigns).items():
        share = sum(case.holds for case in cases) / len(cases)
        error = median(case.error for case in cases)
        print(f"| {name} | {len(cases)} | {share:.0%} | {error:.0%} |")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""How sure the statements about campaigns are, and how long a summary of a large one takes.

    python tests/bench/confidence.py [--campaigns 2000] [--runs 100000] [--pairs 400]
                                      [--sequential 1000]

Simulates campaigns whose true rates are known. Coverage: how often an interval that is looked at
after every 5 of 100 runs misses the truth at least once, the anytime interval beside Wilson's.
Gate: two campaigns of 20 configurations, 20 runs each, of which 70 % hardly fail, 10 % always and
the others sometimes; in the second one each fails more often by 0, 5, 10 or 20 points. How often
the gate says "worse": by Fisher's test, and by pairs where the seed decides what happens in nine of
ten runs; and how often "more failed than before". Sequential: campaigns of 100 configurations, of
which 70 are sound, 10 always fail and 20 fail in 5 to 20 % of all runs; how many runs a sequential
test between 5 and 20 % saves beside 50 for each, and how often it is wrong about those that are
sound or broken; and the same for robots exactly at the two rates. Summary: `vast results summary`
of a stored campaign of so many runs, beside reading its records alone (open, read, close), in
turns; wall and CPU time.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from robovast.base.sequential import SequentialTest, State
from robovast.base.statistics import anytime, wilson
from robovast.campaign.verdict import Verdict
from robovast.evaluation.compare import compare
from robovast.evaluation.summaries import RunSummary, VariantRuns

VAST = str(Path(sys.executable).with_name("vast"))
NAME = "hall-2026-03-04-132444"


def missed(campaigns: int, rng: random.Random) -> dict[str, float]:
    """Share of campaigns in which an interval misses the truth at any look."""
    wrong = dict.fromkeys((anytime, wilson), 0)
    for _ in range(campaigns):
        rate = rng.uniform(0.01, 0.5)
        runs = [rng.random() < rate for _ in range(100)]
        looks = [(sum(runs[:n]), n) for n in range(5, 101, 5)]
        for interval in wrong:
            ranges = (interval(bad, n) for bad, n in looks)
            wrong[interval] += not all(low <= rate <= high for low, high in ranges)
    return {interval.__name__: count / campaigns for interval, count in wrong.items()}


def simulated(rates: list[float], chances: list[list[float]], *, seeded: bool) -> list[VariantRuns]:
    """A campaign whose run fails if its chance is below the rate of its configuration."""
    return [
        VariantRuns(
            f"hall-{place}",
            "hall",
            {"speed": place},
            tuple(
                RunSummary(
                    number,
                    Verdict.FAILED if chance < rate else Verdict.PASSED,
                    "",
                    None,
                    None,
                    100 * place + number if seeded else None,
                )
                for number, chance in enumerate(chances[place])
            ),
        )
        for place, rate in enumerate(rates)
    ]


def found_worse(pairs: int, rise: float, rng: random.Random) -> dict[str, float]:
    """How often so many pairs of campaigns are said to have got worse, by method."""
    said = dict.fromkeys(("Fisher", "equal seeds", "more failed"), 0)
    for _ in range(pairs):
        before = [
            *(rng.uniform(0, 0.02) for _ in range(14)),
            *(1.0 for _ in range(2)),
            *(rng.uniform(0.05, 0.5) for _ in range(4)),
        ]
        after = [min(1.0, rate + rise) for rate in before]
        chances, others = ([[rng.random() for _ in range(20)] for _ in before] for _ in range(2))
        mixed = [
            [other if rng.random() < 0.1 else chance for chance, other in zip(*both, strict=True)]
            for both in zip(chances, others, strict=True)
        ]
        base, apart, alike = (
            simulated(before, chances, seeded=True),
            simulated(after, others, seeded=False),
            simulated(after, mixed, seeded=True),
        )
        by_fisher = compare(base, apart)
        said["Fisher"] += by_fisher.result == "worse"
        said["equal seeds"] += compare(base, alike).result == "worse"
        said["more failed"] += by_fisher.overall.b.bad > by_fisher.overall.a.bad
    return {method: count / pairs for method, count in said.items()}


TEST = SequentialTest(good=0.05, bad=0.2, error=0.05, least=3, most=50)


def runs_needed(campaigns: int, sound: float, rng: random.Random) -> dict[str, float]:
    """Shares of runs saved, of wrong decisions, and of configurations that stay undecided.

    Args:
        campaigns: how many.
        sound: highest rate of a sound configuration.
        rng: of the campaigns.
    """
    runs, ends = 0, dict.fromkeys(State, 0)
    wrong = {State.BROKEN: 0, State.SOUND: 0}
    for _ in range(campaigns):
        rates = [rng.uniform(0, sound) for _ in range(70)] + [1.0] * 10
        rates += [rng.uniform(TEST.good, TEST.bad) for _ in range(20)]
        for place, rate in enumerate(rates):
            end = TEST.decide(rng.random() < rate for _ in range(50))
            runs, ends[end.state] = runs + end.runs, ends[end.state] + 1
            wrong[State.BROKEN] += place < 70 and end.state is State.BROKEN
            wrong[State.SOUND] += 70 <= place < 80 and end.state is State.SOUND
    return {
        "runs saved": 1 - runs / campaigns / 100 / 50,
        "sound called broken": wrong[State.BROKEN] / campaigns / 70,
        "broken called sound": wrong[State.SOUND] / campaigns / 10,
        "undecided": ends[State.UNDECIDED] / campaigns / 100,
    }


def wrong_at(rate: float, state: State, robots: int, rng: random.Random) -> float:
    """Share of robots of a rate whose test ends in a state."""
    ends = (TEST.decide(rng.random() < rate for _ in range(50)).state for _ in range(robots))
    return sum(end is state for end in ends) / robots


def measure_sequential(campaigns: int, rng: random.Random) -> None:
    """Print what a sequential test saves, and how often it is wrong."""
    print(f"{campaigns} campaigns with a sequential test; goals: 60 % saved, 5 % wrong")
    for sound in (0.0, 0.01, 0.02, 0.05):
        shares = runs_needed(campaigns, sound, rng).items()
        told = ", ".join(f"{what} {share:.2%}" for what, share in shares)
        print(f"sound ones fail in up to {sound:.0%}: {told}")
    for rate, state in ((TEST.good, State.BROKEN), (TEST.bad, State.SOUND)):
        print(f"{rate:.0%} called {state}: {wrong_at(rate, state, 100 * campaigns, rng):.2%}")


def write_campaign(results: Path, variants: int, runs: int, rng: random.Random) -> Path:
    """A campaign of records alone."""
    root = results / NAME
    (root / "_execution").mkdir(parents=True)
    (root / "_execution" / "execution.yaml").write_text(f"runs: {runs}\n")
    for place in range(variants):
        for number in range(runs):
            bad = rng.random() < place % 10 / 20
            folder = root / f"hall-{place + 1}" / str(number)
            folder.mkdir(parents=True)
            (folder / "run.json").write_text(json.dumps(_record(place, number, bad), indent=1))
    return root


def _record(place: int, number: int, bad: bool) -> dict[str, object]:
    return {
        "campaign": NAME,
        "variant": f"hall-{place + 1}",
        "entry": "hall",
        "run": number,
        "id": number,
        "verdict": "failed" if bad else "passed",
        "reason": "goal not reached: no goal after 20 s" if bad else "",
        "started_at": "2026-03-04T13:24:44.123456+00:00",
        "finished_at": "2026-03-04T13:24:54.123456+00:00",
        "duration": 10.0,
        "exit_code": 0,
        "attempt": 1,
        "job": f"job-{number}",
        "runtime": "docker",
        "image": "robots/hall:7",
        "image_digest": "sha256:" + 64 * "a",
        "host": "bench",
        "parameters": {"speed": place / 10, "goal": "door"},
        "schema": 1,
    }


def read_alone(root: Path) -> None:
    """Read every record, and nothing else."""
    for variant in os.scandir(root):
        for run in os.scandir(variant) if variant.name.startswith("hall") else ():
            descriptor = os.open(f"{run.path}/run.json", os.O_RDONLY)
            os.read(descriptor, 1 << 16)
            os.close(descriptor)


def summarize(root: Path) -> None:
    """What a user types."""
    subprocess.run([VAST, "results", "summary", str(root)], stdout=subprocess.DEVNULL, check=True)


def timed(work: Callable[[Path], None], root: Path) -> tuple[float, float]:
    """Wall and CPU time [s]."""
    before, begin = _cpu(), time.monotonic()
    work(root)
    return time.monotonic() - begin, _cpu() - before


def _cpu() -> float:
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in used)


def measure_summary(runs: int, rng: random.Random) -> None:
    """Print how long a summary takes."""
    with TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as name:
        root = write_campaign(Path(name), runs // 20, 20, rng)
        for work in (summarize, read_alone):
            work(root)  # what the kernel must first read is not measured
        times: dict[Callable[[Path], None], list[tuple[float, float]]] = {}
        for work in (summarize, read_alone) * 5:
            times.setdefault(work, []).append(timed(work, root))
    for work, measured in times.items():
        (wall, _), *_ = ordered = sorted(measured)
        cpu = statistics.median(cpu for _, cpu in measured)
        middle, most = statistics.median(wall for wall, _ in measured), ordered[-1][0]
        print(f"{work.__name__}: {middle:.2f} s [{wall:.2f}-{most:.2f}], CPU {cpu:.2f} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--campaigns", type=int, default=2000)
    parser.add_argument("--runs", type=int, default=100_000)
    parser.add_argument("--pairs", type=int, default=400)
    parser.add_argument("--sequential", type=int, default=1000)
    arguments = parser.parse_args()
    rng = random.Random(1)  # noqa: S311
    print(f"{arguments.campaigns} campaigns looked at after every 5 of 100 runs; goal 5 %")
    for name, share in missed(arguments.campaigns, rng).items():
        print(f"{name}: misses the truth at least once in {share:.1%}")
    print(f"said to be worse, of {arguments.pairs} pairs of campaigns; goal 5 % without a rise")
    for points in (0, 5, 10, 20):
        shares = found_worse(arguments.pairs, points / 100, rng).items()
        told = ", ".join(f"{method} {share:.1%}" for method, share in shares)
        print(f"{points:2} points: {told}")
    measure_sequential(arguments.sequential, rng)
    print(f"summary of {arguments.runs} runs; goal 2 s")
    measure_summary(arguments.runs, rng)


if __name__ == "__main__":
    main()

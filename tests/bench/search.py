"""Measures searches: the share of a space that a failure map misjudges, and what proposing costs.

    python tests/bench/search.py map [--seeds 8] [--problem landing] [--runs 1] [--initial 16]
    python tests/bench/search.py coverage [--seeds 8] [--problem landing]
    python tests/bench/search.py workers [--jobs 8]
    python tests/bench/search.py computed
    python tests/bench/search.py propose
    python tests/bench/search.py worst [--seeds 8]
    python tests/bench/search.py qd [--seeds 5]      # also needs: pip install ribs

`map` compares the sets of `boundary` with random ones and those of a Sobol sequence: 96 sets of 3
runs, judged by the same Gaussian process; `alone` is `boundary` told of each batch before it is
asked for the next one, `further` has three batches open. `workers` executes a search whose runs
vary fivefold in time, with one to three batches open, and prints which share of the workers' time
is used, and which the same runs use as a campaign without a search: what they lack is the
machine's, the rest is the search's loss. `computed` computes the search's share without the cost
of starts and proposals, `filled` where the second batch is part of the first, even filling of the
space and waits for nothing. `propose` times a
batch of 20 after 1,000 and 10,000 sets in 10 dimensions. `worst` counts the runs until TPE, and
until random sets, reach what one random set in a thousand does. `qd` fills an archive of what an
arm of 8 joints reaches, beside pyribs.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import sys
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from heapq import heapreplace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.special import expit
from scipy.stats import qmc

from robovast.campaign.layout import Layout
from robovast.execution.local import ExecutionSummary, LocalOptions, run_campaign
from robovast.model.document import load_document
from robovast.model.document.search.section import Search
from robovast.search import batches
from robovast.search.batches import ENOUGH, OPEN
from robovast.search.history import SearchHistory
from robovast.search.local import run_search
from robovast.search.plugins import strategy_of
from robovast.search.strategies.boundary import BoundaryParameters, BoundaryStrategy
from robovast.search.strategies.failure_process import Array
from robovast.search.strategies.quality_diversity import (
    QualityDiversityParameters,
    QualityDiversityStrategy,
)
from robovast.search.types import Evaluation, ParamSet

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.campaigns.local import Recorder

SETS, RUNS, BATCH, POINTS = 96, 3, 8, 1024
AHEAD = {"alone": 1, "further": 3}
"""Open batches of the ways that differ from a search, which has two where each has 24 runs."""
MOST = 4096
"""Most sets that a worst case is looked for with."""
STEP, SECONDS = 0.02, 40.0


def landing(x: Array, generator: np.random.Generator) -> Array:
    """Whether landings of a drone fail: one a row of mass, gain, wind, delay and height, in [0, 1].

    It sinks at a speed that shrinks with the height, held by a delayed controller that knows a
    nominal mass; gusts push it up, down and aside. It fails when it touches down too fast, too far
    away, or never.
    """
    mass = 0.7 + 0.8 * x[:, 0]
    gain = 3.0 * 5.0 ** x[:, 1]
    wind = 8.0 * x[:, 2]
    delay = (1 + 14 * x[:, 3]).astype(int)
    height = 4.0 + 16.0 * x[:, 4]
    speed, aside, drift = np.zeros(len(x)), np.zeros(len(x)), np.zeros(len(x))
    gust = np.zeros(len(x))
    landed, failed = np.zeros(len(x), bool), np.ones(len(x), bool)
    steps = int(SECONDS / STEP)
    memory = np.zeros((25, len(x)))
    for step in range(steps):
        memory[step % 25] = speed
        seen = memory[(step - delay) % 25, np.arange(len(x))]
        wanted = -np.clip(0.35 * height, 0.4, 2.0)
        thrust = np.clip(9.81 + gain * (wanted - seen), 0.0, 18.0)
        gust += STEP * -0.5 * gust + np.sqrt(STEP) * 0.08 * wind * generator.standard_normal(len(x))
        speed = speed + STEP * (thrust / mass - 9.81 + 0.3 * gust)
        aside += STEP * (0.4 * (wind * 0.3 + gust - aside) - 0.8 * drift)
        drift += STEP * aside
        height = height + STEP * speed
        touches = (height <= 0) & ~landed
        failed[touches] = (speed[touches] < -1.5) | (np.abs(drift[touches]) > 1.2)
        landed |= touches
        height = np.where(landed, 0.0, height)
    return failed


def example(x: Array, generator: np.random.Generator) -> Array:
    """Whether landings of configs/examples/drone_landing fail."""
    speed, aside = touchdown(x, generator)
    return np.asarray(~((speed >= -1.2) & (np.abs(aside) <= 1.5)))


def touchdown(x: Array, generator: np.random.Generator) -> tuple[Array, Array]:
    """Speed and distance aside of landings of configs/examples/drone_landing: one a row of mass,
    gain, delay, wind and shelter, over the ranges of search_boundary.vast; nan of those that stay
    in the air."""
    mass = 0.7 + 0.8 * x[:, 0]
    gain = 10.0 ** x[:, 1]
    late = np.round(0.4 * x[:, 2] / STEP).astype(int)
    strength = np.sqrt(STEP) * 0.25 * 16.0 * x[:, 3] * (1.0 - 0.9 * x[:, 4])
    height, speed = np.full(len(x), 10.0), np.zeros(len(x))
    aside, drift, gust = np.zeros(len(x)), np.zeros(len(x)), np.zeros(len(x))
    memory = np.zeros((21, len(x)))
    landed_at = np.full((2, len(x)), np.nan)
    for step in range(int(30.0 / STEP)):
        memory[step % 21] = speed
        seen = np.where(late <= step, memory[(step - late) % 21, np.arange(len(x))], 0.0)
        wanted = -np.clip(0.5 * height, 0.4, 2.0)
        thrust = np.clip(9.81 + gain * (wanted - seen), 0.0, 18.0)
        gust += STEP * -0.8 * gust + strength * generator.standard_normal(len(x))
        speed = speed + STEP * (thrust / mass - 9.81 + 0.5 * gust)
        drift += STEP * (gust - 1.5 * aside - 1.2 * drift)
        aside += STEP * drift
        height = height + STEP * speed
        lands = np.isnan(landed_at[0]) & (height <= 0.0)
        landed_at[:, lands] = speed[lands], aside[lands]
    return landed_at[0], landed_at[1]


def _chance(x: Array) -> Array:
    """Probability of failure of the analytic problem: three of ten dimensions matter most."""
    ridge = 6.0 * (x[:, 0] - 0.5) + 5.0 * (x[:, 1] - 0.5) ** 2 - 4.0 * (x[:, 2] * x[:, 3] - 0.25)
    return np.asarray(expit(4.0 * (ridge + 0.5 * (x[:, 4:].mean(axis=1) - 0.5) - 0.6)))


def analytic(x: Array, generator: np.random.Generator) -> Array:
    """Failures in ten dimensions, with noise where failing and passing meet."""
    return np.asarray(generator.random(len(x)) < _chance(x))


@dataclass(frozen=True)
class Problem:
    """A problem whose truth is known."""

    dimensions: int
    fails: Callable[[Array, np.random.Generator], Array]

    def truth(self, points: Array) -> Array:
        """Whether points fail more often than not."""
        if self.fails is analytic:
            return np.asarray(_chance(points) > 0.5)
        generator = np.random.default_rng(99)
        rate = np.mean([self.fails(points, generator) for _ in range(41)], axis=0)
        return np.asarray(rate > 0.5)


PROBLEMS = {
    "landing": Problem(5, landing),
    "example": Problem(5, example),
    "analytic": Problem(10, analytic),
}


def section(strategy: str, dimensions: int, seed: int, per_batch: int = BATCH) -> Search:
    """The section of a search in a unit cube."""
    space = {f"x{i}": {"type": "float", "low": 0.0, "high": 1.0} for i in range(dimensions)}
    return Search.model_validate(
        {
            "strategy": strategy,
            "search_space": space,
            "objectives": [{"name": "failure_rate"}],
            "budget": [{"batches": 1}],
            "per_batch": per_batch,
            "seed": seed,
        }
    )


def strategy(dimensions: int, seed: int, **parameters: Any) -> BoundaryStrategy:
    """`boundary` in a unit cube."""
    return BoundaryStrategy(section("boundary", dimensions, seed), BoundaryParameters(**parameters))


class Execution:
    """Executes sets, and remembers the runs of each."""

    def __init__(self, problem: Problem, seed: int, usual: int = RUNS) -> None:
        self.problem = problem
        self.usual = usual
        self.generator = np.random.default_rng([seed, 7])
        self.failures: dict[str, list[bool]] = {}
        self.runs = 0

    def evaluate(self, params: ParamSet) -> Evaluation:
        """Run a set as often as it asks for."""
        done = self.failures.setdefault(params.id, [])
        missing = (params.n_reps or self.usual) - len(done)
        if missing > 0:
            x = np.tile(list(params.values.values()), (missing, 1))
            done.extend(self.problem.fails(x, self.generator).tolist())
            self.runs += missing
        return Evaluation(params, {"failure_rate": float(np.mean(done))}, {}, len(done))


def search(
    problem: Problem, seed: int, how: str, runs: int = RUNS, initial: int | None = None
) -> BoundaryStrategy:
    """The strategy after all sets."""
    sets, per_batch = SETS * RUNS // runs, BATCH * RUNS // runs
    chosen = strategy(problem.dimensions, seed, initial=sets if how == "sobol" else initial)
    execution = Execution(problem, seed, runs)
    drawn = np.random.default_rng([seed, 5]).random((sets, problem.dimensions))
    given = [ParamSet(dict(zip(chosen.search_space, row, strict=True))) for row in drawn.tolist()]
    results: deque[list[Evaluation]] = deque()
    while execution.runs < SETS * RUNS:
        first = execution.runs // runs
        left = min(per_batch, sets - first)
        proposed = given[first : first + left] if how == "random" else chosen.ask(left)
        evaluated = [execution.evaluate(params) for params in proposed]
        results.append(evaluated)
        if len(results) >= (AHEAD.get(how, 2) if chosen.known else 1):
            chosen.tell(results.popleft())
    for evaluated in results:
        chosen.tell(evaluated)
    return chosen


def misjudged(chosen: BoundaryStrategy, points: Array, truth: Array) -> float:
    """The share of points that the map of one search gets wrong."""
    assert chosen.process is not None
    mean, _ = chosen.process.predict(points)
    return float(np.mean((mean > 0) != truth))


def coverage(names: list[str], seeds: int) -> None:
    """Print how many intervals of critical values have the true one within."""
    line = np.linspace(0.0, 1.0, 101)
    for name in names:
        problem = PROBLEMS[name]
        units = np.full((problem.dimensions, len(line), problem.dimensions), 0.5)
        for column in range(problem.dimensions):
            units[column, :, column] = line
        truth = [problem.truth(points) for points in units]
        within, found, open_ = 0, 0, 0
        for seed in range(seeds):
            made = search(problem, seed, "boundary").map()
            found_values = made.critical([0.5] * problem.dimensions)
            first = {critical.name: critical for critical in reversed(found_values)}
            for fails, name_ in zip(truth, made.space, strict=True):
                critical = first[name_]
                ends = line[np.flatnonzero(fails[1:] != fails[:-1])] + 0.005
                if critical.low is not None and critical.high is not None and len(ends):
                    found += 1
                    open_ += critical.open is not None
                    low, high = critical.low - 0.005, critical.high + 0.005  # half a step
                    within += bool(np.any((ends > low) & (ends < high)))
        print(
            f"{name}: {within} of {found} intervals have the true value within; "
            f"{open_} of them end where the space does",
            flush=True,
        )


def compare(names: list[str], seeds: int, hows: list[str], runs: int, initial: int | None) -> None:
    """Print the share that each way of choosing misjudges."""
    for name in names:
        problem = PROBLEMS[name]
        points = qmc.Sobol(problem.dimensions, rng=np.random.default_rng(3)).random(POINTS)
        truth = problem.truth(points)
        print(f"{name}: {truth.mean():.1%} fail")
        for how in hows:
            made = (search(problem, seed, how, runs, initial) for seed in range(seeds))
            shares = [misjudged(chosen, points, truth) for chosen in made]
            ends = f"{min(shares):.1%} to {max(shares):.1%}"
            print(f"  {how:<9} {np.mean(shares):.1%} misjudged, {ends}", flush=True)


CAMPAIGN = """\
version: 1
metadata: {name: workers}
execution: {scenario_file: scenario.osc, runs: 1, run_files: [step.sh]}
"""
WORKERS = """\
search:
  strategy: boundary
  search_space: {x: {type: float, low: 0.0, high: 1.0}, y: {type: float, low: 0.0, high: 1.0}}
  objectives: [{name: failure_rate}]
  per_batch: 8
  budget: [{batches: 8}]
"""
STEP_SCRIPT = """\
import hashlib, sys, time
time.sleep(2 + hashlib.sha256(sys.argv[1].encode()).digest()[0] / 32)  # 2 to 10 s
sys.exit(float(sys.argv[1]) > 0.5)
"""
SCENARIO = """\
import osc.helpers

scenario workers:
    x: float = 0.0
    y: float = 0.0
    here: common
    do serial:
        run_process("python3 " + here.get_scenario_file_directory() + "/step.sh %s" % x)
"""


def workers(many: int) -> None:
    """Print which share of the workers' time runs take, of a search as plain processes and of a
    campaign of the same runs without one."""
    for open_ in range(1, OPEN + 1):
        with (
            TemporaryDirectory(prefix="robovast-") as folder,
            patch.object(batches, "OPEN", open_),
        ):
            share, made = _executed(Path(folder, "search"), WORKERS, many, run_search)
            sets = [
                params.values
                for batch in SearchHistory(Layout(made.campaign)).batches
                for params in batch.proposal.sets
            ]
            given = [{"name": f"c{i}", "parameters": [v]} for i, v in enumerate(sets)]
            plain = f"configuration: {json.dumps(given)}\n"
            most, _ = _executed(Path(folder, "plain"), plain, many, run_campaign)
        runs = f"{len(made.records)} runs, {many} workers, {open_} open"
        load = f"load {os.getloadavg()[0]:.0f}"
        print(f"{runs}: {share:.0%}; without a search {most:.0%}", end="; ")
        print(f"the search has {share / most:.0%} of that; {load}", flush=True)


def _executed(
    folder: Path, extra: str, many: int, execute: Callable[..., ExecutionSummary]
) -> tuple[float, ExecutionSummary]:
    """The share of the workers' time that runs of a document take, and what was executed."""
    folder.mkdir()
    (folder / "step.sh").write_text(STEP_SCRIPT)
    (folder / "scenario.osc").write_text(SCENARIO)
    path = folder / "workers.vast"
    path.write_text(CAMPAIGN + extra)
    options = LocalOptions(runtime="process", jobs=many)
    began = time.perf_counter()
    made = execute(load_document(path), folder / "out", options, Recorder())
    took = time.perf_counter() - began
    return sum(record.duration for record in made.records) / took / many, made


def computed() -> None:
    """Print the same for 12 batches, computed."""
    many = 8
    for size in (4, 8, 16, 24):
        shares = []
        usual = OPEN if size < ENOUGH else 2
        ways = (("1 open", 1, 1), ("2", 2, 1), ("3", 3, 1), ("filled", usual, 2))
        for name, open_, filling in ways:
            found = [_share(size, many, open_, filling, seed) for seed in range(40)]
            shares.append(f"{name} {np.mean(found):.0%}")
        print(f"{many} workers, batches of {size} runs: {', '.join(shares)}")


def _share(size: int, many: int, open_: int, filling: int, seed: int, batches: int = 12) -> float:
    """The share of the workers' time that runs of 1 to 5 take which start and end at no cost, the
    first batches being asked for at once."""
    times = np.random.default_rng(seed).uniform(1.0, 5.0, (batches, size))
    free, ends, now = [0.0] * many, list[float](), 0.0
    for scored in range(batches):
        while len(ends) < min(batches, max(filling, scored + open_ if scored else 1)):
            ended: list[float] = []
            for took in times[len(ends)]:
                ended.append(max(free[0], now) + took)
                heapreplace(free, ended[-1])
            ends.append(max(ended))
        now = max(now, ends[scored])
    return float(times.sum() / many / max(free))


JOINTS, BINS, PER_BATCH = 8, 32, 20


def arm(units: Array) -> tuple[Array, Array]:
    """How even the joints of arms are bent, and where their hands are in [-1, 1]²."""
    angles = (units - 0.5) * 2 * np.pi
    around = np.cumsum(angles, axis=1)
    hand = np.stack([np.cos(around).mean(axis=1), np.sin(around).mean(axis=1)], axis=1)
    return -units.var(axis=1), hand


def qd(seeds: int) -> None:
    """Print coverage and score of our archive and of those of pyribs, at equal evaluations."""
    for count in (10, 50, 250):
        for name, fill in (("ours", _ours), ("pyribs CMA-ME", _ribs), ("pyribs Iso+LineDD", _ribs)):
            found = np.array([fill(name, seed, count) for seed in range(seeds)])
            (coverage, score), low, high = found.mean(axis=0), found.min(axis=0), found.max(axis=0)
            filled = f"coverage {coverage:.1%} ({low[0]:.1%} to {high[0]:.1%})"
            summed = f"score {score:.1f} ({low[1]:.1f} to {high[1]:.1f})"
            print(f"{count * PER_BATCH:>5} {name:<18} {filled}, {summed}", flush=True)


def _ours(name: str, seed: int, count: int) -> tuple[float, float]:
    del name
    axis = {"low": -1.0, "high": 1.0, "bins": BINS}
    parameters = {"archive": {"measures": {"x": axis, "y": axis}}}
    made = QualityDiversityStrategy(
        section("qd", JOINTS, seed, PER_BATCH),
        QualityDiversityParameters.model_validate(parameters),
    )
    for _ in range(count):
        sets = made.ask(PER_BATCH)
        scores, hands = arm(np.array([list(params.values.values()) for params in sets]))
        made.tell(
            [
                # pyribs sums what is above its offset, -1
                Evaluation(params, {"failure_rate": 1 + score}, {"x": hand[0], "y": hand[1]}, 1)
                for params, score, hand in zip(sets, scores.tolist(), hands.tolist(), strict=True)
            ]
        )
    extra = made.report().extra
    return extra["coverage"], extra["qd_score"]


def _ribs(name: str, seed: int, batches: int) -> tuple[float, float]:
    from ribs.archives import GridArchive
    from ribs.emitters import EvolutionStrategyEmitter, IsoLineEmitter
    from ribs.schedulers import Scheduler

    archive = GridArchive(
        solution_dim=JOINTS, dims=[BINS, BINS], ranges=[(-1, 1), (-1, 1)], qd_score_offset=-1.0,
        seed=seed,
    )  # fmt: skip
    middle, bounds = [0.5] * JOINTS, ([0.0] * JOINTS, [1.0] * JOINTS)
    common: dict[str, Any] = {"lower_bounds": bounds[0], "upper_bounds": bounds[1], "seed": seed}
    if "CMA" in name:
        emitter = EvolutionStrategyEmitter(
            archive, x0=middle, sigma0=0.1, batch_size=PER_BATCH, ranker="2imp", **common
        )
    else:
        emitter = IsoLineEmitter(
            archive, x0=middle, iso_sigma=0.1, line_sigma=0.2, batch_size=PER_BATCH, **common
        )
    scheduler = Scheduler(archive, [emitter])
    for _ in range(batches):
        scores, hands = arm(scheduler.ask())
        scheduler.tell(scores, hands)
    return float(archive.stats.coverage), float(archive.stats.qd_score)


def worst(seeds: int) -> None:
    """Print how many runs it takes to land as far away as one random set in a thousand does."""
    generator = np.random.default_rng(11)
    rare = float(np.quantile(distance(generator.random((8192, 5)), generator), 0.999))
    print(f"looked for: {rare:.2f} m, mean of {RUNS} runs")
    for how in ("optuna", "random"):
        found = sorted(_until(how, seed, rare) for seed in range(seeds))
        middle = float(np.median(found)) * RUNS
        print(f"{how}: {middle:.0f} runs, {found[0] * RUNS} to {found[-1] * RUNS}", flush=True)


def distance(x: Array, generator: np.random.Generator) -> Array:
    """How far away landings of sets end, means of their runs; 0 of those that stay in the air."""
    _, aside = touchdown(np.tile(x, (RUNS, 1)), generator)
    return np.asarray(np.nan_to_num(np.abs(aside)).reshape(RUNS, -1).mean(axis=0))


def _until(how: str, seed: int, rare: float) -> int:
    """Number of sets until one is as bad, at most `MOST`."""
    chosen = strategy_of(section(how, 5, seed), Path("search.vast"))
    generator = np.random.default_rng([seed, 12])
    size = BATCH if how == "optuna" else MOST // 4  # random sets do not depend on results
    for sets in range(0, MOST, size):
        asked = chosen.ask(size)
        scores = distance(np.array([list(params.values.values()) for params in asked]), generator)
        if (scores >= rare).any():
            return sets + int(np.argmax(scores >= rare)) + 1
        told = zip(asked, scores.tolist(), strict=True)
        chosen.tell([Evaluation(p, {"failure_rate": s}, {}, RUNS) for p, s in told])
    return MOST


def propose() -> None:
    """Print time and memory of one proposal."""
    for sets in (1_000, 10_000):
        chosen = strategy(10, 0)
        units = np.random.default_rng(1).random((sets, 10))
        execution = Execution(PROBLEMS["analytic"], 0)
        names = list(chosen.search_space)
        told = [ParamSet(dict(zip(names, row, strict=True))) for row in units.tolist()]
        chosen.repeat(sets, told)
        chosen.tell([execution.evaluate(params) for params in told])
        began = time.perf_counter()
        chosen.ask(20)
        took = time.perf_counter() - began
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"20 sets after {sets:,}: {took:.2f} s, {peak:.0f} MiB at most")


WHAT = ("map", "coverage", "workers", "computed", "propose", "worst", "qd")

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=WHAT)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--initial", type=int, help="sets before the map of `boundary` decides")
    parser.add_argument("--jobs", type=int, default=8, help="workers")
    parser.add_argument("--runs", type=int, default=RUNS, help="of a set; the total stays")
    parser.add_argument("--problem", choices=sorted(PROBLEMS), action="append")
    parser.add_argument(
        "--how", choices=["boundary", "alone", "further", "random", "sobol"], action="append"
    )
    given = parser.parse_args()
    if given.what == "propose":
        propose()
    elif given.what == "worst":
        worst(given.seeds)
    elif given.what == "workers":
        workers(given.jobs)
    elif given.what == "computed":
        computed()
    elif given.what == "coverage":
        coverage(given.problem or sorted(PROBLEMS), given.seeds)
    elif given.what == "qd":
        qd(given.seeds)
    else:
        ways = given.how or ["boundary", "alone", "random", "sobol"]
        compare(given.problem or sorted(PROBLEMS), given.seeds, ways, given.runs, given.initial)

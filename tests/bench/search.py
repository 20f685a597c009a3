"""Measures searches: the share of a space that a failure map misjudges, and what proposing costs.

    python tests/bench/search.py map [--seeds 8] [--problem landing] [--jobs 1]
    python tests/bench/search.py propose
    python tests/bench/search.py qd [--seeds 5]      # also needs: pip install ribs

`map` compares the sets of `boundary` with random ones and those of a Sobol sequence: 96 sets of 3
runs, judged by the same Gaussian process. `propose` times a batch of 20 after 1,000 and 10,000
sets in 10 dimensions. `qd` fills an archive of what an arm of 8 joints reaches, beside pyribs.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import expit
from scipy.stats import qmc

from robovast.model.document.model import Search
from robovast.search.strategies.boundary import BoundaryParameters, BoundaryStrategy
from robovast.search.strategies.failure_process import Array
from robovast.search.strategies.quality_diversity import (
    QualityDiversityParameters,
    QualityDiversityStrategy,
)
from robovast.search.types import Evaluation, ParamSet

SETS, RUNS, BATCH, POINTS = 96, 3, 8, 1024
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


PROBLEMS = {"landing": Problem(5, landing), "analytic": Problem(10, analytic)}


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

    def __init__(self, problem: Problem, seed: int) -> None:
        self.problem = problem
        self.generator = np.random.default_rng([seed, 7])
        self.failures: dict[str, list[bool]] = {}
        self.runs = 0

    def evaluate(self, params: ParamSet) -> Evaluation:
        """Run a set as often as it asks for."""
        done = self.failures.setdefault(params.id, [])
        missing = (params.n_reps or RUNS) - len(done)
        if missing > 0:
            x = np.tile(list(params.values.values()), (missing, 1))
            done.extend(self.problem.fails(x, self.generator).tolist())
            self.runs += missing
        return Evaluation(params, {"failure_rate": float(np.mean(done))}, {}, len(done))


def misjudged(problem: Problem, seed: int, how: str, points: Array, truth: Array) -> float:
    """The share of points that the map of one search gets wrong."""
    chosen = strategy(problem.dimensions, seed, initial=SETS if how == "sobol" else None)
    execution = Execution(problem, seed)
    drawn = np.random.default_rng([seed, 5]).random((SETS, problem.dimensions))
    given = [ParamSet(dict(zip(chosen.search_space, row, strict=True))) for row in drawn.tolist()]
    while execution.runs < SETS * RUNS:
        left = min(BATCH, SETS - execution.runs // RUNS)
        first = execution.runs // RUNS
        proposed = given[first : first + left] if how == "random" else chosen.ask(left)
        chosen.tell([execution.evaluate(params) for params in proposed])
    assert chosen.process is not None
    mean, _ = chosen.process.predict(points)
    return float(np.mean((mean > 0) != truth))


def compare(names: list[str], seeds: int, hows: list[str]) -> None:
    """Print the share that each way of choosing misjudges."""
    for name in names:
        problem = PROBLEMS[name]
        points = qmc.Sobol(problem.dimensions, rng=np.random.default_rng(3)).random(POINTS)
        truth = problem.truth(points)
        print(f"{name}: {truth.mean():.1%} fail")
        for how in hows:
            shares = [misjudged(problem, seed, how, points, truth) for seed in range(seeds)]
            ends = f"{min(shares):.1%} to {max(shares):.1%}"
            print(f"  {how:<9} {np.mean(shares):.1%} misjudged, {ends}", flush=True)


JOINTS, BINS, PER_BATCH = 8, 32, 20


def arm(units: Array) -> tuple[Array, Array]:
    """How even the joints of arms are bent, and where their hands are in [-1, 1]²."""
    angles = (units - 0.5) * 2 * np.pi
    around = np.cumsum(angles, axis=1)
    hand = np.stack([np.cos(around).mean(axis=1), np.sin(around).mean(axis=1)], axis=1)
    return -units.var(axis=1), hand


def qd(seeds: int) -> None:
    """Print coverage and score of our archive and of those of pyribs, at equal evaluations."""
    for batches in (10, 50, 250):
        for name, fill in (("ours", _ours), ("pyribs CMA-ME", _ribs), ("pyribs Iso+LineDD", _ribs)):
            found = np.array([fill(name, seed, batches) for seed in range(seeds)])
            (coverage, score), low, high = found.mean(axis=0), found.min(axis=0), found.max(axis=0)
            filled = f"coverage {coverage:.1%} ({low[0]:.1%} to {high[0]:.1%})"
            summed = f"score {score:.1f} ({low[1]:.1f} to {high[1]:.1f})"
            print(f"{batches * PER_BATCH:>5} {name:<18} {filled}, {summed}", flush=True)


def _ours(name: str, seed: int, batches: int) -> tuple[float, float]:
    del name
    axis = {"low": -1.0, "high": 1.0, "bins": BINS}
    parameters = {"archive": {"measures": {"x": axis, "y": axis}}}
    made = QualityDiversityStrategy(
        section("qd", JOINTS, seed, PER_BATCH),
        QualityDiversityParameters.model_validate(parameters),
    )
    for _ in range(batches):
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


def propose() -> None:
    """Print time and memory of one proposal."""
    for sets in (1_000, 10_000):
        chosen = strategy(10, 0)
        units = np.random.default_rng(1).random((sets, 10))
        execution = Execution(PROBLEMS["analytic"], 0)
        names = list(chosen.search_space)
        told = [ParamSet(dict(zip(names, row, strict=True))) for row in units.tolist()]
        chosen.replay(sets, told, [execution.evaluate(params) for params in told])
        began = time.perf_counter()
        chosen.ask(20)
        took = time.perf_counter() - began
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"20 sets after {sets:,}: {took:.2f} s, {peak:.0f} MiB at most")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["map", "propose", "qd"])
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--problem", choices=sorted(PROBLEMS), action="append")
    parser.add_argument("--how", choices=["boundary", "random", "sobol"], action="append")
    given = parser.parse_args()
    if given.what == "propose":
        propose()
    elif given.what == "qd":
        qd(given.seeds)
    else:
        ways = given.how or ["boundary", "random", "sobol"]
        compare(given.problem or sorted(PROBLEMS), given.seeds, ways)

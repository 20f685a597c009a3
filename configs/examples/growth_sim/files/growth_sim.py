#!/usr/bin/env python3
"""Logistic growth: a population grows until its environment is full.

Writes `population.csv` (step, population) into the output folder. The process fails, and with it
the scenario, when the last population stays below the expected share of the capacity.
"""

import argparse
import csv
import sys
from pathlib import Path

import numpy as np


def simulate(initial: float, rates: np.ndarray, capacity: float) -> np.ndarray:
    """Population after each step, the start included: one value more than there are rates."""
    population = np.empty(len(rates) + 1)
    population[0] = initial
    for step, rate in enumerate(rates):
        now = population[step]
        population[step + 1] = now + rate * now * (1 - now / capacity)
    return population


def main() -> int:
    parser = argparse.ArgumentParser(description="logistic growth")
    parser.add_argument("--initial-population", type=float, required=True)
    parser.add_argument("--growth-rate", type=float, required=True)
    parser.add_argument("--capacity", type=float, default=1000)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--expected", type=float, default=0.0)
    parser.add_argument("--noise", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, required=True)
    arguments = parser.parse_args()

    spread = np.random.default_rng(arguments.seed).normal(1.0, arguments.noise, arguments.steps)
    population = simulate(
        arguments.initial_population, arguments.growth_rate * spread, arguments.capacity
    )
    with (arguments.output / "population.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["step", "population"])
        writer.writerows((step, round(float(value), 3)) for step, value in enumerate(population))

    share = population[-1] / arguments.capacity
    print(f"final population {population[-1]:.1f}, {share:.0%} of the capacity")
    if share >= arguments.expected:
        return 0
    print(f"share below {arguments.expected}", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())

"""NumPy's legacy random numbers without NumPy.

Users' results depend on `numpy.random.seed(…)` and `numpy.random.normal(…)`, whose algorithms are
fixed (NumPy's NEP 19): the Mersenne Twister, which Python has as well, seeded by its authors'
first method, and Marsaglia's polar method, which yields two numbers at a time.
"""

from __future__ import annotations

import math
import random

_WORDS = 624
_32_BITS = 0xFFFFFFFF


class LegacyRandom:
    """Generates the numbers that NumPy draws after `numpy.random.seed(seed)`.

    Args:
        seed: from 0 to 2**32 - 1.

    Raises:
        ValueError: the seed is out of range.
    """

    def __init__(self, seed: int) -> None:
        if not 0 <= seed <= _32_BITS:
            raise ValueError(f"a seed is a whole number from 0 to {_32_BITS}, not {seed}")
        words = [seed]
        for number in range(1, _WORDS):
            last = words[-1]
            words.append((1812433253 * (last ^ (last >> 30)) + number) & _32_BITS)
        self._generator = random.Random()  # noqa: S311  # repeatable on purpose
        self._generator.setstate((3, (*words, _WORDS), None))
        self._spare: float | None = None

    def normal(self, mean: float, std: float) -> float:
        """Draw a number from a normal distribution."""
        return mean + std * self._gauss()

    def _gauss(self) -> float:
        if self._spare is not None:
            spare, self._spare = self._spare, None
            return spare
        while True:
            x1 = 2.0 * self._generator.random() - 1.0
            x2 = 2.0 * self._generator.random() - 1.0
            square = x1 * x1 + x2 * x2
            if 0.0 < square < 1.0:
                break
        factor = math.sqrt(-2.0 * math.log(square) / square)
        self._spare = factor * x1
        return factor * x2

"""Seeds of random numbers: one for each campaign, and from it one for each run.

A run's seed follows from the campaign's seed, the variant's name and the run's number alone, so
that it is the same on every machine, in every order, and however many runs are appended.
"""

from __future__ import annotations

import hashlib
import secrets

LARGEST_SEED = 2**31 - 1
"""Every simulator and language takes seeds of 31 bits."""


def draw_seed() -> int:
    """A campaign's seed when its document sets none."""
    return secrets.randbelow(LARGEST_SEED + 1)


def run_seed(campaign_seed: int | None, variant: str, number: int) -> int | None:
    """The seed of a run; None in a campaign without one, of RoboVAST 1.x.

    Args:
        campaign_seed: of the campaign.
        variant: name of the run's variant.
        number: of the run within its variant.
    """
    if campaign_seed is None:
        return None
    return hashed_seed(f"{campaign_seed}/{variant}/{number}")


def hashed_seed(text: str) -> int:
    """The first 32 bits of the text's SHA-256, without the highest one."""
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4]) & LARGEST_SEED

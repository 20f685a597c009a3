"""Mutated files make no reader fail with anything but an error of RoboVAST's own."""

from __future__ import annotations

import subprocess
import sys
from itertools import chain

from support.core_only import ROOT
from support.fuzzing.listed import COVERED, TRUSTED, parsing_modules
from support.fuzzing.readers import READERS

SECONDS = 20
SEED = 20261125


def test_each_module_that_parses_has_a_reader_or_a_reason() -> None:
    listed = list(chain(*COVERED.values(), *TRUSTED.values()))
    assert len(listed) == len(set(listed))
    assert sorted(set(parsing_modules()) - set(listed)) == []
    assert sorted(set(listed) - set(parsing_modules())) == []
    assert set(COVERED) <= set(READERS)


def test_readers_bear_mutated_files() -> None:
    command = [sys.executable, ROOT / "tests/bench/fuzz.py", "--seconds", str(SECONDS)]
    result = subprocess.run(
        [*command, "--seed", str(SEED)], capture_output=True, text=True, timeout=10 * SECONDS
    )
    print(f"seed {SEED}\n{result.stdout}")
    assert result.returncode == 0, result.stdout[-10_000:] + result.stderr[-2000:]

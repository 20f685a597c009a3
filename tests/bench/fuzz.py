"""Mutate files for every reader of untrusted data, and report every error that is not its own.

Usage:
    python tests/bench/fuzz.py [--seconds N] [--reader NAME] [--seed N] [--case N]

Each reader works in a process of its own with a limit of memory and a limit of time for each case.
A fault is printed with the command that repeats it. Exit code 1: there was a fault.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
import traceback
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.fuzzing.mutation import mutated
from support.fuzzing.readers import READERS, inputs

MEMORY = 4 << 30
"""Address space of a reader's process [byte]."""
LONGEST = 20
"""Time limit of a case [s]."""
MOST_FAULTS = 5
"""A reader ends after so many."""


class TooLongError(BaseException):
    """A case took too long."""


def run_case(name: str, seed: int, number: int, folder: Path) -> str:
    """Mutate one case and read it; returns the fault, or nothing."""
    from robovast.base.errors import RobovastError

    reader, chance = READERS[name], Random(f"{seed} {name} {number}")  # noqa: S311
    folder.mkdir()
    try:
        reader.make(folder, chance)
        files = sorted(inputs(folder, reader))
        for path in chance.sample(files, min(len(files), chance.choice((1, 1, 1, 2)))):
            other = chance.choice(files).read_bytes()
            path.chmod(0o644)
            path.write_bytes(mutated(path.read_bytes(), other, chance))
        signal.setitimer(signal.ITIMER_REAL, LONGEST)
        reader.read(folder, chance)
    except RobovastError:
        pass
    except (Exception, TooLongError):
        return traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        shutil.rmtree(folder, ignore_errors=True)
    return ""


def fuzz(name: str, seconds: float, seed: int, only: int | None) -> int:
    """Fuzz one reader in this process; returns the number of faults."""
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, most))

    def too_long(*_: object) -> None:
        raise TooLongError

    signal.signal(signal.SIGALRM, too_long)
    end, number, faults = time.monotonic() + seconds, only or 0, set[str]()
    with TemporaryDirectory(prefix="robovast-fuzz-") as place:
        os.environ.update(HOME=place, XDG_CACHE_HOME=place)
        while only == number or (only is None and time.monotonic() < end):
            print(f"{name} {number}", file=sys.stderr, flush=True)  # the last one, if this dies
            fault = run_case(name, seed, number, Path(place) / "case")
            kind = "\n".join(fault.splitlines()[-3:])
            if fault and kind not in faults:
                faults.add(kind)
                command = (
                    f"python tests/bench/fuzz.py --reader {name} --seed {seed} --case {number}"
                )
                print(f"{fault}\n{command}\n", flush=True)
            number += 1
            if len(faults) == MOST_FAULTS:
                break
    print(f"{name}: {number} cases, {len(faults)} faults", flush=True)
    return len(faults)


def fuzz_apart(name: str, seconds: float, seed: int) -> tuple[int, str]:
    """Fuzz one reader in a process of its own; returns its exit code and what it printed."""
    words = ["--seconds", str(seconds), "--reader", name, "--seed", str(seed)]
    limit = seconds + 5 * LONGEST
    with TemporaryDirectory() as folder, (Path(folder) / "cases").open("w+") as cases:
        try:
            ended = subprocess.run(
                [sys.executable, __file__, *words],
                stdout=subprocess.PIPE, stderr=cases, text=True, timeout=limit, check=False,
            )  # fmt: skip
            code, said = ended.returncode, ended.stdout
        except subprocess.TimeoutExpired as error:
            code, said = 1, (error.stdout or b"").decode() + f"{name} did not end\n"
        cases.seek(0)
        last = cases.read()[-2000:]
    return code, said if code in (0, 1) and "did not end" not in said else f"{said}{last}\n"


def main() -> int:
    """Fuzz the readers that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="time for all readers")
    parser.add_argument("--reader", choices=READERS, help="only this one")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--case", type=int, help="only this case of the reader")
    given = parser.parse_args()
    if given.reader:
        return min(1, fuzz(given.reader, given.seconds, given.seed, given.case))
    workers = os.cpu_count() or 1
    each = given.seconds * workers / len(READERS)
    with ThreadPoolExecutor(workers) as pool:
        results = list(pool.map(lambda name: fuzz_apart(name, each, given.seed), READERS))
    for _, said in results:
        print(said, end="")
    return max(min(1, abs(code)) for code, _ in results)


if __name__ == "__main__":
    sys.exit(main())

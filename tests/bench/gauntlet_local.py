#!/usr/bin/env python3
"""Faults at random while campaigns are executed on this machine; at the end all is compared.

    python tests/bench/gauntlet_local.py --minutes 15 --seed 1

Campaigns whose every run's right verdict and files are known run as plain processes, one after the
other. Meanwhile `vast` and runs are killed, the power is cut (on a disk that forgets what was not
synced; needs root), the disk is full, records are spoiled, and a campaign is started twice. Each is
resumed until it is at its end, then its results, and what `vast` had said of them, are compared
with the truth. Exit code 1 when a run was lost, executed again after it was stored, misjudged or
mixed.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.faults.power_cut import CAN_CUT_POWER, PowerCutDisk, power_cut_disk
from support.gauntlet.executions import Sink, sending
from support.gauntlet.truth import Course, Kind, look_at_files, read_trace

from robovast.campaign.run_record import read_run_record
from robovast.campaign.verdict import Verdict
from robovast.execution.contract.monitor_resources import family

VAST = Path(sys.executable).with_name("vast")
DISK = "96M"
KINDS = (*[Kind.PASS] * 6, Kind.FAIL, Kind.ODD, Kind.PASS, Kind.CRASH, Kind.ODD, Kind.FAIL)
"""What runs do; none takes memory, since plain processes have no limits."""
PATIENCE = 240.0
"""When an execution that nobody disturbs is taken for hung [s]."""
CALM_AFTER = 6
"""So many faults a campaign gets, then it may end."""
EXPECTED = (0, 1, 4, 5, 130, -signal.SIGKILL, -signal.SIGINT)
"""Exit codes; Ctrl-C may come before `vast` has begun to listen."""
SPOILED = ("", "{", '{"schema": 2}', "[" * 9999)


@dataclass
class Tally:
    """What happened, and what is wrong."""

    campaigns: int = 0
    runs: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    lost: list[str] = field(default_factory=list)
    twice: list[str] = field(default_factory=list)
    misjudged: list[str] = field(default_factory=list)
    mixed: list[str] = field(default_factory=list)
    other: list[str] = field(default_factory=list)
    """What a command did that it must not."""

    @property
    def wrong(self) -> list[str]:
        """Everything that must not have happened."""
        return [*self.lost, *self.twice, *self.misjudged, *self.mixed, *self.other]

    def __str__(self) -> str:
        faults = ", ".join(f"{number} × {name}" for name, number in sorted(self.faults.items()))
        return (
            f"{self.campaigns} campaigns, {self.runs} runs, {self.faults.total()} faults "
            f"({faults}); {len(self.lost)} runs lost, {len(self.twice)} executed again after they "
            f"were stored, {len(self.misjudged)} misjudged, {len(self.mixed)} mixed, "
            f"{len(self.other)} other errors"
        )


class Vast:
    """A `vast` that executes a campaign, and what it has said."""

    def __init__(self, *arguments: str | Path, heard: Callable[[str], None]) -> None:
        command = [VAST, *arguments]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(
            command, stdout=pipe, stderr=subprocess.STDOUT, text=True, start_new_session=True
        )
        self.lines: list[str] = []
        self._heard = heard
        self._reader = Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line.rstrip())
            self._heard(line)

    def wait(self, timeout: float) -> int | None:
        """Its exit code; None when it has not ended by then."""
        try:
            code = self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            return None
        self._reader.join()
        return code


class Heat:
    """One campaign: executed, disturbed, resumed, compared."""

    def __init__(
        self, course: Course, place: Path, disk: PowerCutDisk | None, dice: random.Random
    ) -> None:
        self.course = course
        self._place = place
        self._disk = disk
        self._dice = dice
        self._out = (disk.root if disk else place) / course.salt
        self._trace = place / "trace"
        self._trace.touch()
        self.told: dict[str, int] = {}
        """Runs that were told to be stored, with the length of the trace then."""
        self._spoiled: set[str] = set()
        self.excused: set[str] = set()
        """Runs that a fault may have made fail: killed, or without room for their files."""

    def execute(self, tally: Tally, until: float) -> None:
        """Execute the campaign through all faults, to its end."""
        document = self.course.write(self._place / "in")
        arguments: list[str | Path] = ["-V", document, "exec", "local", "run", "-o", self._out]
        faults = self._faults()
        left = self._dice.randint(2, CALM_AFTER)
        while True:
            vast = Vast(*arguments, "--runtime", "process", "-j", "2", heard=self._hear)
            if left and time.monotonic() < until:
                code = vast.wait(self._dice.uniform(0.3, 7))
                if code is None:
                    name = self._dice.choice(list(faults))
                    faults[name](vast, tally)
                    tally.faults[name] += 1
                    left -= 1
                    code = vast.wait(PATIENCE)
            else:
                code = vast.wait(PATIENCE)
            if code is None:
                tally.other.append(f"{self.course.salt}: hangs: {vast.lines[-3:]}")
                self._kill(vast)
            elif code not in EXPECTED:
                tally.other.append(f"{self.course.salt}: exit code {code}: {vast.lines[-5:]}")
            if code in (0, 1, 4) or len(tally.other) > 9:
                break
            if campaign := self._campaign():
                if self._dice.random() < 0.3:
                    self._spoil(campaign, tally)
                arguments = ["exec", "local", "run", "--resume", campaign]
            else:
                shutil.rmtree(self._out, ignore_errors=True)
        self._compare(tally)

    def _faults(self) -> dict[str, Callable[[Vast, Tally], None]]:
        always = {
            "vast killed": self._kill_vast,
            "run killed": self._kill_run,
            "started twice": self._start_twice,
            "Ctrl-C": self._interrupt,
        }
        of_a_disk = {"power cut": self._cut, "disk full": self._fill}
        return {**always, **(of_a_disk if self._disk else {})}

    def _kill_vast(self, vast: Vast, _: Tally) -> None:
        vast.process.kill()

    def _interrupt(self, vast: Vast, _: Tally) -> None:
        vast.process.send_signal(signal.SIGINT)

    def _kill_run(self, _: Vast, __: Tally) -> None:
        found = [(process, run) for process in _processes(self._out) if (run := _run_of(process))]
        if found:
            process, run = self._dice.choice(found)
            self.excused.add(run)
            _kill(process)

    def _start_twice(self, _: Vast, tally: Tally) -> None:
        if campaign := self._campaign():
            other = Vast("exec", "local", "run", "--resume", campaign, heard=lambda line: None)
            code = other.wait(PATIENCE)
            if code not in (0, 1, 4, 5, 2):
                tally.other.append(f"{self.course.salt}: second start: {code}: {other.lines[-5:]}")
                self._kill(other)

    def _cut(self, vast: Vast, _: Tally) -> None:
        assert self._disk is not None
        self._disk.cut()
        self._kill(vast)
        self._disk.restart()

    def _fill(self, vast: Vast, _: Tally) -> None:
        assert self._disk is not None
        filler = self._disk.root / "filler"
        free = shutil.disk_usage(self._disk.root).free
        before = set(self.told)
        with filler.open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, max(1, free - self._dice.randint(0, 200_000)))
        if vast.wait(self._dice.uniform(3, 15)) is None:
            self._kill(vast)
        self.excused |= self._begun().keys() - before
        filler.unlink()

    def _kill(self, vast: Vast) -> None:
        """Kill a vast and all that it started."""
        vast.process.kill()
        for process in _processes(self._out):
            _kill(process)
        vast.wait(PATIENCE)

    def _spoil(self, campaign: Path, tally: Tally) -> None:
        """Let a record be one that nobody understands."""
        records = sorted(campaign.glob("one-*/*/run.json"))
        if records:
            record = self._dice.choice(records)
            with record.open("w") as out:
                out.write(self._dice.choice(SPOILED))
                out.flush()
                os.fsync(out.fileno())  # else a power cut brings the good record back
            run = f"{record.parent.parent.name}/{record.parent.name}"
            self._spoiled.add(run)
            self.told.pop(run, None)
            tally.faults["record spoiled"] += 1

    def _campaign(self) -> Path | None:
        """The campaign's folder, once it can be resumed."""
        found = [*self._out.glob("*/_execution/execution.yaml")]
        return found[0].parent.parent if found and found[0].stat().st_size else None

    def _hear(self, line: str) -> None:
        words = line.partition("]")[2].split()
        if line.startswith("[") and len(words) > 1 and words[0] != Verdict.INTERRUPTED:
            self.told[words[1].rstrip(":")] = self._trace.stat().st_size

    def _compare(self, tally: Tally) -> None:
        campaign = self._campaign()
        truth = self.course.truth()
        tally.campaigns += 1
        tally.runs += len(truth)
        begun = self._begun()
        for run, right in truth.items():
            name = f"{self.course.salt} {run}"
            folder = campaign / run if campaign else Path(os.devnull)
            record = read_run_record(folder)
            if record is None:
                tally.lost.append(f"{name}: has no record")
                continue
            if any(when >= self.told.get(run, sys.maxsize) for when in begun.get(run, ())):
                tally.twice.append(f"{name}: began again after it was told to be stored")
            seen = look_at_files(self.course, run, dict(_files(folder)))
            spared = run in self.excused and record.verdict is not Verdict.PASSED
            if record.verdict is not right and not spared:
                tally.misjudged.append(f"{name}: {record.verdict}, not {right}: {record.reason}")
            if len(seen.executions) > 1:
                tally.mixed.append(f"{name}: files of {len(seen.executions)} executions")
            elif seen.wrong and not spared:
                tally.lost.append(f"{name}: {'; '.join(seen.wrong[:3])}")
        for run in self._spoiled:
            if campaign and not (campaign / ".aside" / run).exists():
                tally.lost.append(f"{self.course.salt} {run}: was not moved aside")

    def _begun(self) -> dict[str, list[int]]:
        """Where in the trace executions of runs began."""
        found: dict[str, list[int]] = {}
        place = 0
        for line in self._trace.read_bytes().splitlines(keepends=True):
            entry = read_trace(line.decode(errors="replace").partition(" ")[2])
            if entry is not None and entry.event == "begin":
                found.setdefault(entry.run, []).append(place)
            place += len(line)
        return found


def _files(folder: Path) -> Iterator[tuple[str, bytes]]:
    for place, _, names in os.walk(folder):
        for name in names:
            path = Path(place, name)
            if not path.is_symlink():
                yield str(path.relative_to(folder)), path.read_bytes()


def _processes(out: Path) -> list[int]:
    """Processes that work in a campaign's folder, or were told to, and what they started."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                told = (entry / "environ").read_bytes() + (entry / "cmdline").read_bytes()
            except OSError:  # it has ended
                continue
            if os.fsencode(out) + b"/" in told.replace(b"\0", b"/"):
                found.append(int(entry.name))
    return family(found)  # what a launcher shows a run has other names


def _run_of(process: int) -> str | None:
    """The run whose script a process is."""
    try:
        place = Path(os.readlink(f"/proc/{process}/cwd"))
    except OSError:
        return None
    return f"{place.parent.name}/{place.name}" if place.parent.name.startswith("one-") else None


def _kill(process: int) -> None:
    try:
        os.kill(process, signal.SIGKILL)
    except ProcessLookupError:
        return


@contextmanager
def _disk(folder: Path) -> Iterator[PowerCutDisk | None]:
    if not CAN_CUT_POWER:
        print("No power cuts and no full disk: they need root and mkfs.ext4.", flush=True)
        yield None
        return
    with power_cut_disk(folder, DISK) as made:
        yield made


@contextmanager
def _sink(trace: Path) -> Iterator[Sink]:
    """Where runs leave their trace, which they cannot write themselves."""
    with Sink(("127.0.0.1", 0), trace) as sink:
        Thread(target=sink.serve_forever).start()
        try:
            yield sink
        finally:
            sink.shutdown()


def race(minutes: float, seed: int) -> Tally:
    """Let campaigns run for some minutes; the last one is brought to its end."""
    dice, tally = random.Random(seed), Tally()  # noqa: S311 - a seed repeats it
    until = time.monotonic() + 60 * minutes
    while time.monotonic() < until and len(tally.other) < 9:
        with (
            TemporaryDirectory(prefix="gauntlet-") as name,
            _disk(Path(name)) as disk,
            _sink(Path(name) / "trace") as sink,
        ):
            course = Course(
                salt=f"heat-{tally.campaigns}",
                trace=sending(*sink.server_address),
                variants=dice.randint(2, 5),
                runs=dice.randint(1, 3),
                runs_per_job=dice.choice((1, 1, 3)),
                timeout=120,
                pause=dice.choice((0.0, 0.3, 1.0)),
                kinds=KINDS,
            )
            Heat(course, Path(name), disk, dice).execute(tally, until)
        print(tally, *tally.wrong, sep="\n    ", flush=True)
    return tally


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=15)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    tally = race(arguments.minutes, arguments.seed)
    print(f"Seed {arguments.seed}, {arguments.minutes:g} minutes: {tally}.")
    sys.exit(bool(tally.wrong))


if __name__ == "__main__":
    main()

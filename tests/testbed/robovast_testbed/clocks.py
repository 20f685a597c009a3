"""Processes of a testbed whose clock is wrong, while the machine's own stays as it is."""

import ctypes
import platform
import signal
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from .errors import StartFailed
from .outages import Process

_VDSO = "linux-vdso.so.1"
_BEFORE, _AFTER = bytes.fromhex("b8e40000000f0585ff7507488106"), b"\xc3"
"""clock_gettime by its system call; to CLOCK_REALTIME, and no other clock, what is between them
is added in seconds:

    mov eax, 228; syscall; test edi, edi; jne end; add qword [rsi], SECONDS; end: ret
"""


@contextmanager
def shifted(process: Process, seconds: int) -> Iterator[None]:
    """Let a process see another time of day for as long as the block runs.

    The kernel maps the code that reads clocks into every process; this one gets code of its own
    there. What it starts meanwhile as another program has the right time.

    :raises StartFailed: when the machine is no x86-64, or the process is in that code all the time.
    """
    if platform.machine() != "x86_64":
        raise StartFailed("clocks are shifted by code for x86-64, which this machine is not")
    memory = Path(f"/proc/{process.pid}/mem")
    code = _BEFORE + struct.pack("<i", seconds) + _AFTER
    with memory.open("r+b", buffering=0) as file:
        begin, end = _vdso(process.pid)
        place = begin + _place()
        file.seek(place)
        original = file.read(len(code))
        _write(process, file, place, code, (begin, end))
        try:
            yield
        finally:
            with suppress(OSError):  # it has ended
                _write(process, file, place, original, (begin, end))


def _place() -> int:
    """Return where the code that reads clocks begins: every process has the same."""
    function = ctypes.CDLL(_VDSO)["__vdso_clock_gettime"]
    address = ctypes.cast(function, ctypes.c_void_p).value or 0
    return address - _vdso("self")[0]


def _vdso(pid: int | str) -> tuple[int, int]:
    for line in Path(f"/proc/{pid}/maps").read_text().splitlines():
        if line.endswith("[vdso]"):
            begin, _, end = line.split()[0].partition("-")
            return int(begin, 16), int(end, 16)
    raise StartFailed(f"process {pid} reads no clocks by itself")


def _write(
    process: Process, file: BinaryIO, place: int, code: bytes, span: tuple[int, int]
) -> None:
    """Write code while none of the process's threads is executing it."""
    for _ in range(100):
        process.signal(signal.SIGSTOP)
        try:
            if not any(span[0] <= at < span[1] for at in _places(process.pid)):
                file.seek(place)
                file.write(code)
                return
        finally:
            process.signal(signal.SIGCONT)
        time.sleep(0.01)
    raise StartFailed(f"{process.command} does nothing but read clocks")


def _places(pid: int) -> Iterator[int]:
    """Return what each thread executes next, once it has stopped: one without CPU takes a while."""
    give_up = time.monotonic() + 10
    for thread in Path(f"/proc/{pid}/task").iterdir():
        while (told := (thread / "syscall").read_text().split()) == ["running"]:
            if time.monotonic() > give_up:
                raise StartFailed(f"process {pid} does not stop")
            time.sleep(0.01)
        yield int(told[-1], 16)

"""Rerun's viewer: an own process, which only this one asks, and the recording as it reads it."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from urllib.error import HTTPError, URLError
from urllib.request import ProxyHandler, build_opener

from robovast.base.errors import CannotRunError, InputError
from robovast.base.optional_deps import RERUN

RECORDING = "recording.rrd"
_START = 20.0
"""How long its server may take to start [s]."""
_HOST = "127.0.0.1"
_DIRECT = build_opener(ProxyHandler({}))


@dataclass(frozen=True)
class Viewer:
    """A running viewer."""

    recording: Path
    port: int

    def page(self, name: str) -> bytes | None:
        """A file of its page; None if there is none of this name."""
        try:
            with _DIRECT.open(f"http://{_HOST}:{self.port}/{name}", timeout=30) as answer:
                return bytes(answer.read())
        except (HTTPError, ValueError):
            return None


@contextmanager
def viewer(recording: Path, name: str, folder: Path) -> Iterator[Viewer]:
    """Rerun with a recording, until the end of the context.

    Args:
        recording: an MCAP file.
        name: what the viewer calls it.
        folder: an empty folder for its settings and files.

    Raises:
        InputError: Rerun cannot read the recording.
        CannotRunError: Rerun is not installed or does not start.
    """
    program, environment = _program(), _environment(folder)
    converted = folder / RECORDING
    done = subprocess.run(
        [
            program,
            "mcap",
            "convert",
            str(recording),
            "-o",
            str(converted),
            "--application-id",
            name,
        ],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode or not os.path.isfile(converted):
        raise InputError(f"Rerun cannot read {recording}: {_last_line(done.stderr)}")
    port = _free_port()
    log = folder / "rerun.log"
    address = f"http://{_HOST}:{port}/{RECORDING}"  # or else it serves the recording itself
    options = ["--serve-web", "--bind", _HOST, "--web-viewer-port", str(port), address]
    with (
        log.open("w") as output,
        subprocess.Popen(
            [program, *options],
            env=environment,
            stdout=output,
            stderr=output,
            start_new_session=True,
        ) as process,
    ):
        try:
            _wait(process, port, log)
            yield Viewer(converted, port)
        finally:
            process.terminate()


def _program() -> str:
    found = find_spec("rerun_cli")
    if found is None or found.origin is None:
        raise RERUN.missing("rerun_cli", "Showing a run in Rerun")
    return str(Path(found.origin).with_name("rerun"))


def _environment(folder: Path) -> dict[str, str]:
    """Settings that end Rerun's reports to its makers, for this process alone."""
    settings = folder / "rerun" / "analytics.json"
    settings.parent.mkdir()
    own = {"analytics_enabled": False, "analytics_id": "", "metadata": {}}
    files = {"config_file_path": str(settings), "data_dir_path": str(folder / "rerun")}
    settings.write_text(json.dumps(own | files))
    return {**os.environ, "XDG_CONFIG_HOME": str(folder), "XDG_DATA_HOME": str(folder)}


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((_HOST, 0))
        return int(probe.getsockname()[1])


def _wait(process: subprocess.Popen[bytes], port: int, log: Path) -> None:
    """Wait for the first answer.

    Raises:
        CannotRunError: the process ends or does not answer.
    """
    until = time.monotonic() + _START
    while process.poll() is None and time.monotonic() < until:
        try:
            with _DIRECT.open(f"http://{_HOST}:{port}/", timeout=5):
                return
        except (URLError, OSError):
            time.sleep(0.05)
    raise CannotRunError(f"Rerun does not start: {_last_line(log.read_text(errors='replace'))}")


def _last_line(text: str) -> str:
    return next(iter(text.strip().splitlines()[-1:]), "no error message.")

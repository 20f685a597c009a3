"""The page of `vast evaluation gui`, served as a user does it."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from http.client import HTTPConnection, HTTPMessage
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from support.patience import PATIENCE

VAST = Path(sys.executable).with_name("vast")


@dataclass(frozen=True)
class Answer:
    status: int
    headers: HTTPMessage
    body: bytes

    @property
    def data(self) -> Any:
        return json.loads(self.body)


@dataclass(frozen=True)
class ShownPage:
    address: str
    process: subprocess.Popen[str]

    @property
    def base(self) -> str:
        """`/<token>/`"""
        return urlsplit(self.address).path

    def ask(
        self, path: str, headers: Mapping[str, str | None] | None = None, method: str = "GET"
    ) -> Answer:
        """Request exactly this path; a header that is None is left out."""
        place = urlsplit(self.address)
        connection = HTTPConnection(place.hostname or "", place.port, timeout=PATIENCE)
        given = {"Host": place.netloc, **(headers or {})}
        connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        for name, value in given.items():
            if value is not None:
                connection.putheader(name, value)
        connection.endheaders()
        response = connection.getresponse()
        answer = Answer(response.status, response.headers, response.read())
        connection.close()
        return answer

    def post(self, path: str, **headers: str | None) -> Answer:
        """Ask as the page does for what is more than looking."""
        origin = {"Origin": self.address.rpartition(self.base)[0]}
        return self.ask(self.base + path, origin | headers, "POST")

    def get(self, path: str, **headers: str | None) -> Answer:
        """Request a path below the token."""
        return self.ask(self.base + path, headers)


@contextmanager
def shown(
    results: Path | None,
    *options: str | Path,
    postprocess: bool = False,
    cwd: Path | None = None,
    end: signal.Signals = signal.SIGINT,
) -> Iterator[ShownPage]:
    """Serve a results folder, or what the options name; ends it, with Ctrl-C or as told, and wants
    it to end well."""
    command: list[str | Path] = [VAST, "evaluation", "gui", "--no-browser", *options]
    command += ["-r", results] if results else []
    if not postprocess:
        command.append("--skip-postprocessing")
    process = subprocess.Popen(
        command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    line = next((line for line in process.stdout if "http://" in line), "")
    try:
        assert line, process.communicate()
        yield ShownPage(line.split()[-1].partition("#")[0], process)
        process.send_signal(end)
        _, complaints = process.communicate(timeout=PATIENCE)
        assert not complaints, complaints
        assert process.returncode == (0 if end == signal.SIGINT else -end)
    finally:
        process.kill()
        process.communicate()

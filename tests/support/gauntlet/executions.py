"""Where executions of runs leave a trace that nothing which happens to them or to us can remove.

    python tests/support/gauntlet/executions.py FILE

takes lines on the node's address and appends each to FILE, with the time, before it answers.
"""

from __future__ import annotations

import socketserver
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from support.gauntlet.truth import Trace, read_trace

ADDRESS = ("10.88.0.1", 7777)


def sending(host: str, port: int) -> str:
    """Command of bash that sends its standard input, a line, and waits for the answer."""
    return (
        "{ IFS= read -r said; for _ in {1..50}; do"
        f' {{ exec 3<>/dev/tcp/{host}/{port} && echo "$said" >&3 && read -r _ <&3; }}'
        " 2>/dev/null && break; sleep 0.2; done; }"
    )


def read_traces(path: Path) -> Iterator[tuple[float, Trace]]:
    """What was taken, and when [s since the epoch]."""
    for line in path.read_text().splitlines():
        seconds, _, rest = line.partition(" ")
        trace = read_trace(rest)
        if trace is not None:
            yield float(seconds), trace


class _Handler(socketserver.StreamRequestHandler):
    timeout = 10
    server: Sink

    def handle(self) -> None:
        line = self.rfile.readline(1000).decode(errors="replace").strip()
        if line:
            with self.server.path.open("a") as file:
                file.write(f"{time.time():.3f} {line}\n")
            self.wfile.write(b"taken\n")


class Sink(socketserver.ThreadingTCPServer):
    """Takes lines."""

    allow_reuse_address = True
    daemon_threads = True
    request_queue_size = 64

    def __init__(self, address: tuple[str, int], path: Path) -> None:
        super().__init__(address, _Handler)
        self.path = path


def main() -> None:
    with Sink(ADDRESS, Path(sys.argv[1])) as server:
        server.serve_forever()


if __name__ == "__main__":
    main()

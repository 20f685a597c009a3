#!/usr/bin/env python3
"""Drives the second robot, in a container of its own: to and fro between two places.

Serves all runs of a job: a run connects, says once what its traffic is like (a line of JSON), then
at each step where both robots are, and gets the velocity of the second one. Nothing is taken from a
clock, and what is drawn comes from the run's seed, so a seed is a drive here, too.
"""

from __future__ import annotations

import json
import math
import os
import random
import socket
import socketserver
import time
from collections.abc import Callable

Point = tuple[float, float]
Velocity = tuple[float, float]
NEAR = 0.1
"""Distance at which the end of the way counts as reached [m]."""
LONGEST_REST = 4.0
"""Time until it starts, at most [s]."""


class Traffic:
    """To and fro; it waits for who is ahead and nearer than its `courtesy` [m]."""

    def __init__(self, seed: int, ends: list[Point], speed: float, courtesy: float) -> None:
        self.ends, self.speed, self.courtesy = ends, speed, courtesy
        self.rest = random.Random(seed).uniform(0.0, LONGEST_REST)  # noqa: S311

    def steer(self, now: float, own: Point, other: Point) -> Velocity:
        """Its velocity, at a simulated time [s], from where both robots are."""
        if math.dist(own, self.ends[1]) < NEAR:
            self.ends = self.ends[::-1]
        x, y = (end - at for end, at in zip(self.ends[1], own, strict=True))
        scale = self.speed / math.hypot(x, y)
        ahead = (other[0] - own[0]) * x + (other[1] - own[1]) * y > 0
        if now < self.rest or (ahead and math.dist(own, other) < self.courtesy):
            scale = 0.0
        return scale * x, scale * y


class Answers(socketserver.StreamRequestHandler):
    """One run; it ends when its simulator does."""

    def handle(self) -> None:
        traffic = Traffic(**json.loads(self.rfile.readline()))
        for line in self.rfile:
            velocity = traffic.steer(*json.loads(line))
            self.wfile.write(json.dumps(velocity).encode() + b"\n")


def connect(patience: float = 20.0, **told: object) -> Callable[..., Velocity]:
    """Asks the other container, which may still be starting, as `Traffic.steer` is asked."""
    os.chdir(os.environ["TRAFFIC_FOLDER"])  # a socket's path may have only 107 characters
    until = time.monotonic() + patience
    while True:
        connection = socket.socket(socket.AF_UNIX)
        try:
            connection.connect(os.environ["TRAFFIC_SOCKET"])
            break
        except OSError:
            connection.close()
            if time.monotonic() > until:
                raise SystemExit("the container `traffic` does not answer") from None
            time.sleep(0.05)
    stream = connection.makefile("rw")
    print(json.dumps(told), file=stream)

    def ask(*where: object) -> Velocity:
        print(json.dumps(where), file=stream, flush=True)
        answer = stream.readline()
        if not answer:
            raise SystemExit("the container `traffic` has ended")
        x, y = json.loads(answer)
        return x, y

    return ask


def main() -> None:
    os.chdir(os.environ["TRAFFIC_FOLDER"])
    path = os.environ["TRAFFIC_SOCKET"]
    if os.path.exists(path):
        os.unlink(path)
    with socketserver.ThreadingUnixStreamServer(path, Answers) as server:
        print("traffic ready", flush=True)
        server.serve_forever()


if __name__ == "__main__":
    main()

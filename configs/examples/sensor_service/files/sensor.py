#!/usr/bin/env python3
"""A sensor: answers every line that it receives with a measurement of the value 1.

A line `seed NUMBER` is not answered: measurements with equal seeds are equal.
"""

import os
import random
import socketserver


class Sensor(socketserver.StreamRequestHandler):
    """One connection; it ends when the client closes it."""

    def handle(self) -> None:
        noise = float(os.environ.get("SENSOR_NOISE", "0"))
        numbers = random.Random()  # noqa: S311
        for line in self.rfile:
            if line.startswith(b"seed"):
                numbers.seed(line)
            else:
                self.wfile.write(f"{numbers.gauss(1.0, noise):.6f}\n".encode())


def main() -> None:
    os.chdir(os.environ["SENSOR_FOLDER"])  # a socket's path may have only 107 characters
    path = os.environ["SENSOR_SOCKET"]
    if os.path.exists(path):
        os.unlink(path)
    with socketserver.ThreadingUnixStreamServer(path, Sensor) as server:
        print("sensor ready", flush=True)
        server.serve_forever()


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""A sensor: answers every line that it receives with a measurement of the value 1."""

import os
import random
import socketserver


class Sensor(socketserver.StreamRequestHandler):
    """One connection; it ends when the client closes it."""

    def handle(self) -> None:
        noise = float(os.environ.get("SENSOR_NOISE", "0"))
        for _ in self.rfile:
            self.wfile.write(f"{random.gauss(1.0, noise):.6f}\n".encode())


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

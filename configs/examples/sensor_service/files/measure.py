#!/usr/bin/env python3
"""Measures the amplified sensor and fails when the mean is too far from 1."""

import argparse
import os
import socket
import sys
import time
from pathlib import Path


def connect(timeout: float = 10.0) -> socket.socket:
    """A connection to the sensor, which may still be starting."""
    os.chdir(os.environ["SENSOR_FOLDER"])
    deadline = time.monotonic() + timeout
    while True:
        connection = socket.socket(socket.AF_UNIX)
        try:
            connection.connect(os.environ["SENSOR_SOCKET"])
        except OSError:
            connection.close()
            if time.monotonic() > deadline:
                raise
            time.sleep(0.05)
        else:
            return connection


def main() -> int:
    parser = argparse.ArgumentParser(description="measure the amplified sensor")
    parser.add_argument("--gain", type=float, required=True)
    parser.add_argument("--bias", type=float, required=True)
    parser.add_argument("--samples", type=int, required=True)
    parser.add_argument("--tolerance", type=float, required=True)
    parser.add_argument("--output", type=Path, required=True)
    arguments = parser.parse_args()
    output = arguments.output.absolute()

    values = []
    with connect() as connection, connection.makefile("rw") as stream:
        # The sensor serves all runs of the job; each run tells it the seed of its own noise.
        stream.write(f"seed {os.environ.get('ROBOVAST_SEED', '')}\n")
        for _ in range(arguments.samples):
            stream.write("?\n")
            stream.flush()
            values.append(arguments.gain * float(stream.readline()) + arguments.bias)

    lines = [f"{index},{value:.6f}" for index, value in enumerate(values)]
    (output / "samples.csv").write_text("\n".join(["sample,value", *lines]) + "\n")
    error = abs(sum(values) / len(values) - 1.0)
    print(f"error of the mean: {error:.3f} (allowed: {arguments.tolerance})")
    return 0 if error <= arguments.tolerance else 1


if __name__ == "__main__":
    sys.exit(main())

"""The commands `up` and `down`."""

import argparse
import sys
from collections.abc import Callable, Sequence

from . import bed, docker
from .errors import StartFailed, Unavailable


def up(arguments: Sequence[str]) -> int:
    """Bring up a testbed that stays; print how to use it."""
    parser = argparse.ArgumentParser(prog="tests/testbed/up", description=up.__doc__)
    kinds = parser.add_subparsers(required=True)
    engine = kinds.add_parser("docker", help="a private Docker daemon with the compose plugin")
    engine.add_argument("--name", default="docker")
    engine.set_defaults(action=_up_docker)
    options = parser.parse_args(arguments)
    return _guarded(lambda: options.action(options))


def down(arguments: Sequence[str]) -> int:
    """Remove one kept testbed, or all of them."""
    parser = argparse.ArgumentParser(prog="tests/testbed/down", description=down.__doc__)
    parser.add_argument("--name", help="of the testbed to remove (default: all kept ones)")
    options = parser.parse_args(arguments)
    return _guarded(lambda: _down([options.name] if options.name else bed.kept()))


def _down(names: Sequence[str]) -> None:
    for name in names:
        bed.release(name)
        print(f"{name} is down")


def _up_docker(options: argparse.Namespace) -> None:
    with bed.keep(options.name) as kept:
        _print_exports(docker.start(kept).env)


def _print_exports(variables: dict[str, str]) -> None:
    for name, value in variables.items():
        print(f"export {name}={value}")


def _guarded(action: Callable[[], None]) -> int:
    try:
        action()
    except (StartFailed, Unavailable) as problem:
        print(problem, file=sys.stderr)
        return 1
    return 0

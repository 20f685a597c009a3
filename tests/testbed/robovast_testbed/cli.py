"""The commands `up` and `down`."""

import argparse
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from . import bed, controlplane, docker, gobuild, images, kueue, kwok, node, programs, s3
from .errors import StartFailed, Unavailable


def up(arguments: Sequence[str]) -> int:
    """Bring up a testbed that stays; print what to export to use it."""
    parser = argparse.ArgumentParser(prog="tests/testbed/up", description=up.__doc__)
    parser.add_argument("kind", nargs="?", choices=("cluster", "docker"), default="cluster")
    parser.add_argument("--name", help="of the testbed (default: its kind)")
    options = parser.add_argument_group("of a cluster")
    size = options.add_mutually_exclusive_group()
    size.add_argument("--control-plane", action="store_true", help="without any node")
    size.add_argument("--node", action="store_true", help="with one real node (default)")
    options.add_argument("--kueue", action="store_true", help="install Kueue; needs the node")
    options.add_argument("--kwok", type=int, default=0, metavar="N", help="add N fake nodes")
    options.add_argument("--s3", action="append", default=[], choices=s3.MAKES, help="repeatable")
    chosen = parser.parse_args(arguments)
    if chosen.kueue and chosen.control_plane:
        parser.error("--kueue needs the node that --control-plane leaves out")
    action = _up_docker if chosen.kind == "docker" else _up_cluster
    return _guarded(lambda: action(chosen))


def down(arguments: Sequence[str]) -> int:
    """Remove what `up` has left running."""
    parser = argparse.ArgumentParser(prog="tests/testbed/down", description=down.__doc__)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--name", help="of the testbed to remove (default: the only one)")
    which.add_argument("--all", action="store_true", help="remove every kept testbed")
    options = parser.parse_args(arguments)
    kept = bed.kept()
    if not options.name and not options.all and len(kept) > 1:
        parser.error(f"say --name or --all: {', '.join(kept)} are up")
    return _guarded(lambda: _down([options.name] if options.name else kept))


def _down(names: Iterable[str]) -> None:
    for name in names:
        bed.release(name)
        print(f"{name} is down")


def _up_docker(options: argparse.Namespace) -> None:
    with bed.keep(options.name or options.kind) as kept:
        _print_exports(docker.start(kept).env)


def _up_cluster(options: argparse.Namespace) -> None:
    with bed.keep(options.name or options.kind) as kept:
        cluster = controlplane.start(kept)
        if not options.control_plane:
            node.start(cluster, [images.archive()])
        if options.kueue:
            kueue.install(cluster)
        if options.kwok:
            kwok.start(cluster, options.kwok, tainted=not options.control_plane)
        stores = [s3.start(kept, make) for make in options.s3]
        tools = {"kubectl": programs.kubectl(), "helm": gobuild.build(programs.HELM)}
        _print_exports(cluster.env | {"PATH": f"{_link(kept.folder / 'bin', tools)}:$PATH"})
    print(f"# in its namespaces: {' '.join(kept.inside)} COMMAND")
    for store in stores:
        print(f"# {store.make}: http://{store.endpoint}, for pods http://{store.inner_endpoint},")
        print(f"#   access key {store.access_key}, secret key {store.secret_key}")


def _link(folder: Path, tools: dict[str, Path]) -> Path:
    folder.mkdir()
    for name, program in tools.items():
        (folder / name).symlink_to(program)
    return folder


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

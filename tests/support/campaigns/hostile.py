"""Runs that try to reach what is not theirs, and what must be of it afterwards."""

from __future__ import annotations

from pathlib import Path

KEY = "private key of the host"


def make_host(folder: Path) -> Path:
    """A folder that is nobody's business."""
    folder.mkdir()
    (folder / "authorized_keys").write_text("keys of the host")
    (folder / "id_ed25519").write_text(KEY)
    return folder


def assert_untouched(host: Path) -> None:
    found = {path.name: path.read_text() for path in host.iterdir()}
    assert found == {"authorized_keys": "keys of the host", "id_ed25519": KEY}


def links(host: Path | str) -> str:
    """A step that makes links to the host in every place that something of ours goes through.

    It calls nothing but bash and coreutils, and passes.
    """
    return f"""
out=$ROBOVAST_OUT_DIR own=$OUTPUT_DIR run=$3 host={host}
ln -sfn "$host" "$own/out"                    # what is moved "to the rest" goes there
echo stolen > "$out/authorized_keys"
mkdir -p "$out/deep/er"
echo stolen > "$out/deep/er/file"
ln -sfn "$host/id_ed25519" "$out/deep/link"
ln -s "$host/id_ed25519" "$run/map.png"       # what is copied comes from there
ln -s "$host" "$run/job"
mkdir "$run/run.json" && echo own > "$run/run.json/file"
ln -s "$host/authorized_keys" "$run/.run.json.$PPID.tmp"
mkfifo "$run/x.csv" "$run/pipe.yaml" "$own/pipe" "$out/pipe"
truncate -s 3T "$run/sparse.csv"
echo 1 > "$run/out.csv"
"""

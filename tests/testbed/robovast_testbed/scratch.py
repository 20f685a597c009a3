"""Images that hold one static program and nothing else."""

import hashlib
import io
import json
import tarfile
from pathlib import Path

from . import cache

REPOSITORY = "localhost/robovast-testbed"


def image(name: str) -> str:
    """Return the full name of the image that holds the program `name`."""
    return f"{REPOSITORY}/{name}:local"


def archive(program: Path, executable: str | None = None) -> Path:
    """Return the cached archive of the image of a cached program; it runs as user 65532.

    :param executable: what the program is called in the image (default: its own name).
    """
    executable = executable or program.name

    def make(folder: Path) -> None:
        layer = folder / "layer.tar"
        with tarfile.open(layer, "w") as tar:
            entry = tarfile.TarInfo(executable)
            entry.mode = 0o755
            entry.size = program.stat().st_size
            with program.open("rb") as stream:
                tar.addfile(entry, stream)
        with tarfile.open(folder / "image.tar", "w") as tar:
            _add_json(tar, "manifest.json", [_manifest(program.name)])
            _add_json(tar, "config.json", _config(executable, _sha256(layer)))
            tar.add(layer, arcname=layer.name)
        layer.unlink()

    return cache.once(f"images/{program.parent.name}-{executable}", make) / "image.tar"


def _manifest(name: str) -> dict[str, object]:
    return {"Config": "config.json", "RepoTags": [image(name)], "Layers": ["layer.tar"]}


def _config(executable: str, diff_id: str) -> dict[str, object]:
    return {
        "architecture": "amd64",
        "os": "linux",
        # A number, so that Kubernetes can tell that it is not root.
        "config": {"Entrypoint": [f"/{executable}"], "User": "65532:65532"},
        "rootfs": {"type": "layers", "diff_ids": [diff_id]},
    }


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return f"sha256:{hashlib.file_digest(stream, 'sha256').hexdigest()}"


def _add_json(tar: tarfile.TarFile, name: str, document: object) -> None:
    content = json.dumps(document).encode()
    entry = tarfile.TarInfo(name)
    entry.size = len(content)
    tar.addfile(entry, io.BytesIO(content))

"""Certificates of one cluster."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from . import debian
from .commands import run

NEW_KEY = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")


@dataclass(frozen=True)
class Certificate:
    """A PEM file and the PEM file of its private key."""

    file: Path
    key: Path


@dataclass(frozen=True)
class Authority:
    """A certificate authority with its folder of certificates."""

    root: Certificate

    def issue(
        self, name: str, user: str, *, group: str = "", sans: Sequence[str] = ()
    ) -> Certificate:
        """Make a certificate that names a user (and group), or a server by its `sans`."""
        made = _certificate(self.root.file.parent, name)
        subject = f"/O={group}/CN={user}" if group else f"/CN={user}"
        extensions = ["basicConstraints=CA:FALSE"]
        if sans:
            extensions.append(f"subjectAltName={','.join(sans)}")
        _make(made, subject, extensions, "-CA", self.root.file, "-CAkey", self.root.key)
        return made


def create(folder: Path) -> Authority:
    """Make a certificate authority in an absent folder."""
    debian.require("openssl")
    folder.mkdir(parents=True)
    root = _certificate(folder, "ca")
    _make(root, "/CN=robovast-testbed", ["keyUsage=critical,keyCertSign"])
    return Authority(root)


def _certificate(folder: Path, name: str) -> Certificate:
    return Certificate(folder / f"{name}.crt", folder / f"{name}.key")


def _make(made: Certificate, subject: str, extensions: list[str], *more: str | Path) -> None:
    command: list[str | Path] = ["openssl", "req", "-x509", *NEW_KEY, "-days", "365", *more]
    command += ["-subj", subject, "-out", made.file, "-keyout", made.key]
    run([*command, *(word for text in extensions for word in ("-addext", text))])

"""Makes our container of a run's pod start sooner; to be imported before anything else of it.

Each pod has one, whose start takes more CPU than all that it does then.
"""

from __future__ import annotations

import gc
import os
import sys
from importlib import import_module
from types import ModuleType
from typing import Any, NoReturn

_UNUSED = (
    *("minio.lifecycleconfig", "minio.minioadmin", "minio.notificationconfig"),
    *("minio.replicationconfig", "minio.select", "minio.objectlockconfig"),
    *("minio.versioningconfig", "minio.sseconfig", "minio.legalhold", "minio.retention"),
    *("minio.commonconfig", "minio.tagging", "configparser", "tarfile", "importlib.metadata"),
)
"""What `minio` imports for what no run needs, with its cryptography more than half of it."""

_OPTIONAL = ("backports", "brotli", "brotlicffi")
"""What it looks for to read compressed answers, for which nobody asks."""


_WITHOUT_PLUGINS = "PYDANTIC_DISABLE_PLUGINS"
"""Variable of pydantic, which otherwise looks for plugins in everything that is installed."""


class _Unused(ModuleType):
    """A module that has a class of any name."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (), {})


def _import_minio() -> None:
    """Import `minio` without these; whoever wants one nonetheless imports it by its name."""
    names = [name for name in _UNUSED if name not in sys.modules]
    if "minio" not in sys.modules:
        absent = [name for name in _OPTIONAL if name not in sys.modules]
        sys.modules |= {name: _Unused(name) for name in names}
        sys.modules |= dict.fromkeys(absent)  # type: ignore[arg-type]  # an import of it fails
        import minio  # noqa: F401

        for name in (*names, *absent):
            del sys.modules[name]


def load(name: str) -> Any:
    """Import a module, and collect garbage from then on; what is there will never be any."""
    if not _IS_BESIDE_RUN:
        return import_module(name)
    gc.disable()
    module = import_module(name)
    gc.freeze()
    gc.enable()
    return module


def end(code: int) -> NoReturn:
    """End this process, whose memory the kernel frees in a fraction of the time of Python."""
    if _IS_BESIDE_RUN:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    raise SystemExit(code)


_IS_BESIDE_RUN = "robovast.agent" in sys.orig_argv and sys.argv[1:2] in (["agent"], ["hold"])
if _IS_BESIDE_RUN:
    gc.disable()  # until everything is imported: hardly anything of that is garbage
    os.environ[_WITHOUT_PLUGINS] = "__all__"
    _import_minio()
    import encodings.idna  # noqa: F401  # for names of hosts: both processes would import it

"""Makes our container of a run's pod start sooner; to be imported before anything else of it.

Each pod has one, whose start takes more CPU than all that it does then.
"""

from __future__ import annotations

import gc
import os
import sys
from importlib import import_module
from types import ModuleType
from typing import Any

_UNUSED = (
    *("minio.lifecycleconfig", "minio.minioadmin", "minio.notificationconfig"),
    *("minio.replicationconfig", "minio.select", "minio.objectlockconfig"),
    *("minio.versioningconfig", "minio.sseconfig", "minio.legalhold", "minio.retention"),
    *("configparser", "tarfile"),
)
"""What `minio` imports for what no run needs, with its cryptography more than half of it."""


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
        sys.modules |= {name: _Unused(name) for name in names}
        import minio  # noqa: F401

        for name in names:
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


_IS_BESIDE_RUN = "robovast.agent" in sys.orig_argv and sys.argv[1:2] in (["agent"], ["hold"])
if _IS_BESIDE_RUN:
    gc.disable()  # until everything is imported: hardly anything of that is garbage
    os.environ[_WITHOUT_PLUGINS] = "__all__"
    _import_minio()

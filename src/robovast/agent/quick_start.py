"""Makes our container of a run's pod start sooner: every pod has one.

Import it first: garbage is collected only after all other imports, since these are never garbage.
"""

from __future__ import annotations

import gc
import os
import sys
from importlib import import_module
from typing import Any, NoReturn

_WITHOUT_PLUGINS = "PYDANTIC_DISABLE_PLUGINS"
"""Variable of pydantic, which otherwise looks for plugins in everything that is installed."""
_IS_BESIDE_RUN = "robovast.agent" in sys.orig_argv and sys.argv[1:2] in (["agent"], ["hold"])


def load(name: str) -> Any:
    """Import a module, and collect garbage only from then on."""
    if not _IS_BESIDE_RUN:
        return import_module(name)
    gc.disable()
    module = import_module(name)
    gc.freeze()
    gc.enable()
    return module


def end(code: int) -> NoReturn:
    """End this process; the kernel frees its memory in a fraction of Python's time."""
    if _IS_BESIDE_RUN:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    raise SystemExit(code)


if _IS_BESIDE_RUN:
    gc.disable()
    os.environ[_WITHOUT_PLUGINS] = "__all__"
    import encodings.idna  # noqa: F401  # for names of hosts: both processes would import it

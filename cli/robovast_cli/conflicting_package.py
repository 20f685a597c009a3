"""Detect the package `robovast` of another project, which overwrites files of RoboVAST."""

from __future__ import annotations

import os
import sysconfig
from pathlib import Path

_BEGINNING, _END = "robovast-", ".dist-info"


def conflict_warning(site: Path | None = None) -> str | None:
    """Return a warning with the remedy if the other project is installed, None otherwise.

    Args:
        site: folder of installed packages (default: the folder of the running Python).
    """
    try:
        names = os.listdir(site or sysconfig.get_path("purelib"))
    except OSError:  # a Python without such a folder has no packages
        return None
    found = [name for name in names if name.startswith(_BEGINNING) and name.endswith(_END)]
    if not found:
        return None
    version = found[0].removeprefix(_BEGINNING).removesuffix(_END)
    return (
        f"warning: the package `robovast` {version} of another project is installed here and "
        "overwrites files of RoboVAST (`robovast-operator`).\n"
        "hint: uninstall both packages, then install `robovast-operator` again."
    )

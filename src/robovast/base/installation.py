"""How RoboVAST was installed: the command that adds packages to the same environment."""

from __future__ import annotations

import json
import shlex
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

if TYPE_CHECKING:
    from importlib.metadata import Distribution

DISTRIBUTION = "robovast-operator"
"""RoboVAST's name on the package index, where `robovast` is another project."""


def install_command(extra: str) -> str:
    """Return the shell command that adds an extra to the RoboVAST that runs.

    The command names what RoboVAST was installed from: the package index, a wheel, a clone or an
    address. If the file or folder is gone, it names the requirements of the extra.
    """
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        installed = distribution(DISTRIBUTION)
    except PackageNotFoundError:  # run from a folder of sources
        wanted = [f"{DISTRIBUTION}[{extra}]"]
    else:
        wanted = _with_extra(installed, extra) or _requirements(installed, extra)
    return f"{_installer()} {shlex.join(wanted)}"


def _installer() -> str:
    """The beginning of a command that changes the environment of the running Python."""
    python = shlex.quote(sys.executable)
    if Path(shutil.which("pip") or "").parent == Path(sys.executable).parent:
        return "pip install"
    if find_spec("pip") is not None:
        return f"{python} -m pip install"
    return f"uv pip install --python {python}"


def _with_extra(installed: Distribution, extra: str) -> list[str]:
    """The words that install RoboVAST from where it came, with an extra; none if that is gone."""
    origin = json.loads(installed.read_text("direct_url.json") or "{}")
    if not origin:
        return [f"{DISTRIBUTION}[{extra}]"]
    url = origin["url"]
    if not url.startswith("file:"):
        version = origin.get("vcs_info", {})
        prefix = f"{version['vcs']}+" if version else ""
        commit = f"@{version['commit_id']}" if version else ""
        return [f"{DISTRIBUTION}[{extra}] @ {prefix}{url}{commit}"]
    path = Path(unquote(urlsplit(url).path))
    if not path.exists():
        return []
    is_editable = origin.get("dir_info", {}).get("editable", False)
    return [*(["--editable"] if is_editable else []), f"{path}[{extra}]"]


def _requirements(installed: Distribution, extra: str) -> list[str]:
    """The requirements of an extra, without its marker."""
    lines = (line.partition(";") for line in installed.requires or ())
    marks = (f"extra == '{extra}'", f'extra == "{extra}"')
    return [name.strip() for name, _, marker in lines if marker.strip() in marks]

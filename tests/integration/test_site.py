"""The documentation site builds without a warning, and needs no other server."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from support.pages import ROOT


def test_the_site_builds_without_a_warning_and_loads_nothing_from_elsewhere(tmp_path: Path) -> None:
    library = tmp_path / "mermaid"
    library.mkdir()
    (library / "mermaid.esm.min.mjs").touch()
    build = ["-m", "sphinx", "-W", "--keep-going", "-q", ROOT / "docs", tmp_path / "site"]
    done = subprocess.run(
        [sys.executable, *build],
        env={**os.environ, "ROBOVAST_MERMAID": str(library)},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "how-to/kubectl.html" in (tmp_path / "site/kubernetes.html").read_text()
    assert (tmp_path / "site/searchindex.js").stat().st_size > 100_000
    for page in (tmp_path / "site").rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert re.findall(r"<script[^>]*src=\"https?:|import\(?[^;\n]*\"https?:", text) == [], page

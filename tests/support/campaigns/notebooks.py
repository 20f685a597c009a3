"""Notebooks, and campaigns that name them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from support.campaigns.stored import write


def notebook_of(*sources: str) -> str:
    """A notebook with these cells, as Jupyter writes it."""
    cells = [
        {
            "cell_type": "code",
            "execution_count": None,
            "id": f"cell-{place}",
            "metadata": {},
            "outputs": [],
            "source": source.splitlines(keepends=True),
        }
        for place, source in enumerate(sources)
    ]
    metadata = {"kernelspec": {"name": "of-another-machine", "display_name": "", "language": ""}}
    return json.dumps({"cells": cells, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5})


def add_notebooks(root: Path, workloads: Mapping[str, Mapping[str, tuple[str, ...]]]) -> None:
    """Let a campaign have workloads: cells by scope, by name."""
    lines = ["version: 1", "evaluation:", "  visualization:"]
    for workload, scopes in workloads.items():
        lines.append(f"  - {workload}:")
        for scope, sources in scopes.items():
            path = f"analysis/{workload}_{scope}.ipynb"
            lines.append(f"      {scope}: {path}")
            write(root / "_config" / path, notebook_of(*sources))
    write(root / "_config" / "hall.vast", "\n".join(lines) + "\n")

"""Draws the provenance graph with Graphviz."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from robovast.base.atomic import appearing_file
from robovast.base.errors import CannotRunError, InputError
from robovast.base.file_errors import writing
from robovast.base.safe_paths import MOST_OF_ALL, read_file
from robovast.model.naming import GRAPH

DOT = "metadata.dot"
PDF = "metadata.pdf"

_SHAPES = {"Activity": "box", "Agent": "house", "Entity": "ellipse"}


def write_drawing(campaign_dir: Path) -> None:
    """Write a campaign's graph as `metadata.dot` and `metadata.pdf`.

    Raises:
        InputError: the campaign has no graph.
        CannotRunError: Graphviz is missing or fails; `metadata.dot` is written.
        StorageError: a file cannot be written.
    """
    try:
        graph = json.loads(read_file(campaign_dir / GRAPH, most=MOST_OF_ALL))
    except (OSError, ValueError) as error:
        raise InputError(
            f"{campaign_dir / GRAPH}: cannot be read",
            hint="run `vast results metadata` to write it",
        ) from error
    dot = campaign_dir / DOT
    with writing(campaign_dir):
        with appearing_file(dot) as part:
            part.write_text("".join(_lines(graph["@graph"])), encoding="utf-8")
        with appearing_file(campaign_dir / PDF) as part:
            _draw(dot, part)


def _draw(dot: Path, pdf: Path) -> None:
    program = shutil.which("dot")
    if program is None:
        raise CannotRunError(
            f"{dot} is written, but Graphviz, which draws it, is missing",
            hint="install `graphviz` with the package manager of your system",
        )
    drawn = subprocess.run(
        [program, "-Tpdf", "-o", pdf, dot], capture_output=True, text=True, check=False
    )
    if drawn.returncode:
        raise CannotRunError(f"Graphviz cannot draw {dot}: {drawn.stderr.strip()}")


def _lines(nodes: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    known = {node["@id"]: node for node in nodes if "@id" in node}
    yield "digraph provenance {\n  rankdir=RL;\n"
    for name, node in known.items():
        shape = next((_SHAPES[kind] for kind in node.get("@type", ()) if kind in _SHAPES), "note")
        yield f"  {_quoted(name)} [shape={shape}];\n"
    for name, node in known.items():
        for key, value in node.items():
            for target in value if isinstance(value, list) else [value]:
                if key != "@id" and isinstance(target, str) and target in known:
                    yield f"  {_quoted(name)} -> {_quoted(target)} [label={_quoted(key)}];\n"
    yield "}\n"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)

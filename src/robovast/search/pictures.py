"""Pictures of what a search found, as PNG or SVG (extra `analysis`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robovast.base.errors import InputError
from robovast.model.document.problems import as_hint, suggest
from robovast.model.document.search.section import SearchDimension
from robovast.model.document.search.space import at, place, ticks
from robovast.search.results import StoredSearch

_COLOURS: dict[str, Any] = {"vmin": 0, "vmax": 1, "cmap": "RdYlBu_r"}
_INTERVAL = ("--", ":")
"""Lines where the lower and the upper end of the interval cross the level."""


def draw_map(stored: StoredSearch, over: Sequence[str], fixed: Mapping[str, Any]) -> Figure:
    """The failure map over two dimensions, with the sets that were run.

    Args:
        stored: a search with a failure map.
        over: the horizontal and the vertical dimension; the first two when empty.
        fixed: values of other parameters; the middle of the space where they are not given.

    Raises:
        InputError: there is no such map, dimension or value.
    """
    space = stored.search.search_space
    if unknown := [name for name in over if name not in space]:
        remedy = as_hint(suggest(unknown[0], space))
        raise InputError(f"`{unknown[0]}` is not a dimension of the search space", hint=remedy)
    chosen = list(over or [name for name in space if name not in fixed][:2])
    if len(chosen) != 2 or chosen[0] == chosen[1]:
        raise InputError(
            "a map requires two different dimensions", hint="use `--over NAME --over NAME`"
        )
    base, found = stored.middle(fixed), stored.failure_map
    drawn = found.over(chosen[0], chosen[1], base)
    axes = (drawn.across, drawn.down)
    figure = Figure(figsize=(6.4, 4.8), layout="constrained")
    plot = figure.add_subplot()
    mesh = plot.pcolormesh(*axes, drawn.rate, **_COLOURS, shading="nearest")
    figure.colorbar(mesh, label="failure rate")
    if min(map(len, axes)) > 1:
        plot.contour(*axes, drawn.rate, levels=[found.level], colors="black")
        for rate, style in zip((drawn.low, drawn.high), _INTERVAL, strict=True):
            plot.contour(*axes, rate, levels=[found.level], colors="black", linestyles=style)
    _draw_sets(plot, stored, chosen)
    _label(plot, space, chosen)
    others = {name: at(space[name], base[i]) for i, name in enumerate(space) if name not in chosen}
    shown = ", ".join(
        f"{n} {v:.4g}" if isinstance(v, float) else f"{n} {v}" for n, v in others.items()
    )
    plot.set_title(shown or stored.search.objectives[0].name, parse_math=False)
    return figure


def draw_progress(stored: StoredSearch) -> Figure:
    """The numbers of the strategy's report after each batch, one above the other."""
    answer = stored.report()
    names = [name for name in answer.columns[1:] if name not in {"batches", "evaluations"}]
    figure = Figure(figsize=(6.4, 1.6 * len(names)), layout="constrained")
    batches = [row[0] for row in answer.rows]
    for plot, name in zip(np.ravel(figure.subplots(len(names), sharex=True)), names, strict=True):
        column = answer.columns.index(name)
        plot.plot(batches, [row[column] for row in answer.rows], marker=".")
        plot.set_ylabel(name, parse_math=False)
    figure.supxlabel("batch")
    return figure


def encoded(figure: Figure, path: Path) -> bytes:
    """The picture in the format of a file's name.

    Raises:
        InputError: it is neither PNG nor SVG.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in {"png", "svg"}:
        raise InputError(
            f"{path}: the name of an image must end in .png or .svg", hint="use such a name"
        )
    file = BytesIO()
    figure.savefig(file, format=kind, dpi=150)
    return file.getvalue()


def _draw_sets(plot: Axes, stored: StoredSearch, chosen: Sequence[str]) -> None:
    """Dots where sets were run; their colour is the rate of their own runs."""
    space, name = stored.search.search_space, stored.search.objectives[0].name
    known = stored.evaluated.values()
    spots = [[place(space[axis], ev.params.values[axis]) for axis in chosen] for ev in known]
    plot.scatter(
        [spot[0] for spot in spots],
        [spot[1] for spot in spots],
        c=[ev.objectives[name] for ev in known],
        **_COLOURS,
        edgecolors="black",
        linewidths=0.6,
        s=22,
    )


def _label(plot: Axes, space: Mapping[str, SearchDimension], chosen: Sequence[str]) -> None:
    """Values at the axes, whose scale is that of the unit interval."""
    for axis, name in zip((plot.xaxis, plot.yaxis), chosen, strict=True):
        axis.set_ticks(*zip(*ticks(space[name]), strict=True), parse_math=False)
        axis.set_label_text(name, parse_math=False)

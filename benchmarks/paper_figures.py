"""Drawings of `paper`: the paper's figures as the laboratory has them. Needs matplotlib, of the group `bench`."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..core import transfer
from . import laboratory
from .paper_pictures import Shot, Synthesis, Variation
from .paper_tables import Objects

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "figures"

INK = {"blue": "#2c3f9e", "green": "#3a8a3e", "red": "#b3252e", "yellow": "#d9a800", "purple": "#6b3a8c"}
_MARKS = "osD^vP*"
_LINES = ("-", (0, (6, 1)), "--", "-.", ":")
_ERROR_TOP = 5.0


def write(name: str, figure: Figure, kind: str = "jpg") -> str:
    """Save a figure in docs/figures ("png" for drawings) and return the line of Markdown that shows it."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    quality: dict[str, Any] = {"pil_kwargs": {"quality": 88}} if kind == "jpg" else {"metadata": {"Software": None}}
    figure.savefig(FOLDER / f"paper_{name}.{kind}", dpi=110, **quality)
    return f"![{name}](figures/paper_{name}.{kind})"


def _codes(image: NDArray) -> NDArray:
    return transfer.SRGB.encode(np.clip(np.asarray(image, float), 0, 1))


def _new(width: float, height: float) -> Figure:
    mpl.rcParams.update({"font.size": 8.5, "axes.spines.top": False, "axes.spines.right": False})
    return Figure(figsize=(width, height), layout="constrained")


def _show(axes: Any, image: NDArray, title: str = "", **settings: Any) -> Any:
    axes.set_axis_off()
    axes.set_title(title, fontsize=8.5)
    return axes.imshow(image, interpolation="nearest", **settings)


def reflectances(objects: Objects, shots: Sequence[Shot]) -> Figure:
    """Fig. 5: one panel for every object, and where the positions are."""
    figure = _new(9.6, 4.8)
    grid = figure.subplots(2, (len(shots) + 2) // 2, squeeze=False).ravel()
    _show(grid[0], _codes(shots[0].image), "positions")
    for position in objects.positions:
        x, y = objects.pixel(position)
        dark = {"color": "black", "lw": 0, "marker": "s", "ms": 3, "mec": "white", "mew": 0.6}
        grid[0].plot(x, y, **dark)
        grid[0].annotate(position, (x, y), (4, 3), textcoords="offset points", color="white", fontsize=8)
    for axes, color, curves in zip(grid[1:], objects.colors, objects.readings, strict=False):
        for number, curve in enumerate(curves[:5]):
            style = {"color": INK[color], "ls": _LINES[number], "lw": 1.3}
            axes.plot(laboratory.BANDS, curve, label=f"position {objects.positions[number]}", **style)
        axes.set(xlim=(400, 700), ylim=(0, 1.25), title=f"{color}", xlabel="wavelength, nm", ylabel="reflectance")
    for axes in grid[len(shots) + 1 :]:
        axes.set_axis_off()
    grid[-1].legend(*grid[1].get_legend_handles_labels(), loc="center", frameon=False, labelcolor="0.2")
    return figure


def coefficients(plastic: Objects, fabric: Objects) -> Figure:
    """Figs. 6 and 4: the pairs of every object at every position, and the same with each position's mean taken off."""
    figure = _new(9.6, 5.4)
    grid = figure.subplots(2, 2)
    for row, objects, title in ((0, plastic, "plastic (Fig. 6)"), (1, fabric, "fabric (Fig. 4)")):
        a, b = (part[:, 1:5] for part in objects.coefficients)
        for n, color in enumerate(objects.colors):
            for p in range(a.shape[1]):
                style = {"color": INK[color], "marker": _MARKS[p], "lw": 0, "ms": 5, "mfc": "none"}
                grid[row, 0].plot(a[n, p], b[n, p], **style)
                grid[row, 1].plot(a[n, p] - a[:, p].mean(), b[n, p] - b[:, p].mean(), **style)
        for p in range(a.shape[1]):
            place = (a[:, p].mean(), b[:, p].mean())
            grid[row, 0].annotate(f"1-{objects.positions[p + 1]}", place, (6, 4), textcoords="offset points")
        grid[row, 0].set(title=title, xlabel="a", ylabel="b")
        grid[row, 1].set(title="the same, less each position's mean", xlabel="a - mean a", ylabel="b - mean b")
        grid[row, 1].axhline(0, color="0.8", lw=0.7, zorder=0)
        grid[row, 1].axvline(0, color="0.8", lw=0.7, zorder=0)
    return figure


def fit(shot: Shot, fits: Variation, which: int) -> Figure:
    """Fig. 7: image, A, B, residual, variation."""
    figure = _new(9.6, 2.4)
    panels = (
        ("B", fits.B[which], 0.0, 0.5),
        ("residual, 0..255", fits.residual[which], 0.0, 2.0),
        ("E_V of (33), 0..255", fits.spread, 0.0, 10.0),
    )
    grid = figure.subplots(1, 5)
    _show(grid[0], _codes(shot.image), "image")
    drawn = _show(grid[1], fits.A[which], "A", vmin=0, vmax=1.2, cmap="gray")
    figure.colorbar(drawn, ax=grid[1], shrink=0.7)
    for axes, (title, values, low, high) in zip(grid[2:], panels, strict=True):
        drawn = _show(axes, values, title, vmin=low, vmax=high, cmap="gray" if title == "B" else "magma")
        figure.colorbar(drawn, ax=axes, shrink=0.7)
    return figure


def syntheses(made: Sequence[Synthesis], original: bool = False) -> Figure:
    """Figs. 8 to 10: synthesized, true, and the difference, a row for each."""
    titles = ["original"] * original + ["synthesized", "true", "CIEDE2000"]
    figure = _new(2.35 * len(titles), 2.2 * len(made) + 0.15)
    grid = figure.subplots(len(made), len(titles), squeeze=False)
    for row, one in zip(grid, made, strict=True):
        pictures = [one.source] * original + [one.made, one.truth]
        for axes, title, picture in zip(row, titles, pictures, strict=False):
            _show(axes, _codes(picture), f"{one.name}: {title}" if axes is row[0] else title)
        error = np.where(one.parts["object"], one.error, np.nan)
        drawn = _show(row[-1], error, titles[-1], vmin=0, vmax=_ERROR_TOP, cmap="magma")
        figure.colorbar(drawn, ax=row[-1], shrink=0.8)
    return figure


def rivals(
    rows: Sequence[Mapping[str, NDArray]], methods: Sequence[str], names: Sequence[str], region: NDArray[np.bool_]
) -> Figure:
    """Fig. 11: the truth and the methods, a row for every target; without the background, as in the paper."""
    columns = ["truth", *methods]
    figure = _new(1.5 * len(columns), 1.6 * len(rows) + 0.3)
    grid = figure.subplots(len(rows), len(columns), squeeze=False)
    for number, (line, pictures, name) in enumerate(zip(grid, rows, names, strict=True)):
        for axes, method in zip(line, columns, strict=True):
            picture = np.where(region[..., None], _codes(pictures[method]), 1.0)
            _show(axes, picture, "" if number else textwrap.fill(method, 18))
        line[0].text(-0.06, 0.5, name, rotation=90, va="center", ha="right", transform=line[0].transAxes)
    return figure

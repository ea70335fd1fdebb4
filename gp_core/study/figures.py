"""Figures of the study as matplotlib figures that belong to the caller; no global state is touched."""

from __future__ import annotations

import io
from collections.abc import Sequence
from itertools import pairwise
from os import PathLike
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from gp_core.constants import METHOD_NAMES
from gp_core.disk import write_bytes
from gp_core.errors import GpError
from gp_core.landmarks.features import CODES, PROBE
from gp_core.study.compare import PROBES, ComparisonReport, ComparisonRow
from gp_core.study.distances import DistanceTable
from gp_core.study.leave_one_out import LeaveOneOutReport
from gp_core.study.limits_of_agreement import AgreementKind, agreement_panels
from gp_core.study.nested_search import NestedReport
from gp_core.study.physical import PhysicalReport
from gp_core.study.reliability import ReliabilityReport
from gp_core.study.simulation import SimulationReport
from gp_core.study.subset_search import SearchReport
from gp_core.validation import FloatArray

__all__ = [
    "comparison",
    "distance_matrix",
    "draw_physical",
    "error_boxes",
    "error_histograms",
    "label_agreement",
    "nested_errors",
    "save_figure",
    "search_curves",
]

LEFT, RIGHT = "#2f6f9f", "#e0a458"
"""Colours of the two sides; distinguishable in grey print and for colour-blind readers."""

AXIS_ERROR, ORIGIN_ERROR = "Modiolar-axis error (degrees)", "Cochlea-origin error (mm)"

ACCENT = "#b5403a"
"""Accent colour."""

_SIDES = {"L": "left", "R": "right"}
_WAYS = {"names": ("o", "by names"), "icp": ("s", "by ICP"), "surface": ("^", "to the bone's surface")}

_INK, _FAINT = "#222222", "#d9d9d9"
_SUFFIXES = (".png", ".pdf", ".svg")
_DPI = 200


def save_figure(figure: Figure, path: str | PathLike[str]) -> None:
    """Write a figure as PNG, PDF or SVG, according to the suffix.

    Parameters
    ----------
    figure : matplotlib Figure
        What to write.
    path : path-like
        Where to write.

    Raises
    ------
    GpError
        Another suffix, or the file cannot be written.
    """
    name = str(path)
    if not name.lower().endswith(_SUFFIXES):
        raise GpError("is not a supported figure format", file=path, remedy="Use .png, .pdf or .svg.")
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=_DPI, format=name.lower().rpartition(".")[2])
    write_bytes(path, drawn.getvalue())


def new_figure(n_rows: int, n_columns: int, size_in: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """Return a figure with a grid of plain axes.

    Parameters
    ----------
    n_rows, n_columns : int
        Size of the grid.
    size_in : (float, float)
        Width and height, inches.

    Returns
    -------
    figure : matplotlib Figure
        The figure.
    axes : list of matplotlib Axes
        Row by row.
    """
    figure = Figure(figsize=size_in, layout="constrained")
    axes = figure.subplots(n_rows, n_columns, squeeze=False).ravel().tolist()
    for ax in axes:
        ax.spines[["top", "right"]].set_visible(False)
        ax.spines[["left", "bottom"]].set(color=_INK, linewidth=0.8)
        ax.tick_params(labelsize=8, color=_INK, labelcolor=_INK, width=0.8, length=3)
    return figure, axes


def label(ax: Axes, letter: str, x: str, y: str) -> None:
    """Label the axes, and mark the panel by a bold letter at its upper left.

    Parameters
    ----------
    ax : matplotlib Axes
        The panel.
    letter : str
        Its letter.
    x, y : str
        Labels of the axes.
    """
    ax.set_xlabel(x, fontsize=9, color=_INK)
    ax.set_ylabel(y, fontsize=9, color=_INK)
    ax.set_title(letter, loc="left", fontsize=10, fontweight="bold", color=_INK)


def distance_matrix(table: DistanceTable) -> Figure:
    """Draw mean and SD of the distances of all pairs as a triangle of cells (Figure 2).

    Parameters
    ----------
    table : DistanceTable
        What to draw.

    Returns
    -------
    matplotlib Figure
        The figure.
    """
    figure, (ax,) = new_figure(1, 1, (9.2, 8.2))
    shown = np.tril(np.ones_like(table.mean, dtype=bool), -1)
    shade = np.where(shown & (table.sd > 0), table.sd, np.nan)
    norm = LogNorm(0.05, 5.0)
    image = ax.imshow(shade, cmap="YlGnBu", norm=norm, aspect="equal")
    for i, j in zip(*np.nonzero(shown & (table.counts > 0)), strict=True):
        spread = table.sd[i, j]
        dark = np.isfinite(spread) and norm(spread) > 0.62
        colour = "white" if dark else _INK
        ax.text(j, i - 0.17, f"{table.mean[i, j]:.1f}", ha="center", va="center", fontsize=6.5, color=colour)
        small = f"({spread:.2f})" if spread < 1 else f"({spread:.1f})"
        if np.isfinite(spread):
            ax.text(j, i + 0.2, small, ha="center", va="center", fontsize=5.2, color=colour)
    for row, code in enumerate(CODES):
        ax.text(row, row, code, ha="center", va="center", fontsize=7.5, fontweight="bold", color=_INK)
    ax.set_axis_off()
    bar = figure.colorbar(image, ax=ax, shrink=0.55, pad=0.01, aspect=28)
    bar.set_label("Standard deviation (mm)", fontsize=9, color=_INK)
    bar.ax.tick_params(labelsize=8)
    bar.ax.set_yticks([0.05, 0.1, 0.2, 0.5, 1, 2, 5], ["0.05", "0.1", "0.2", "0.5", "1", "2", "5"])
    bar.ax.minorticks_off()
    ax.text(
        0.98,
        0.96,
        f"Distance between features: mean (SD), mm, {table.n_sides} sides",
        transform=ax.transAxes,
        ha="right",
        fontsize=10,
        color=_INK,
    )
    return figure


def error_histograms(report: LeaveOneOutReport) -> Figure:
    """Draw histograms of both errors over the held-out sides (Figure 6 A and B).

    Parameters
    ----------
    report : LeaveOneOutReport
        What to draw.

    Returns
    -------
    matplotlib Figure
        The figure.
    """
    figure, (first, second) = new_figure(1, 2, (7.0, 2.9))
    sides = np.array([row.side for row in report.rows])
    _histogram(first, report.errors.e_ma_deg, sides, 1.0)
    _histogram(second, report.errors.e_co_mm, sides, 0.05)
    label(first, "A", AXIS_ERROR, "Held-out sides")
    label(second, "B", ORIGIN_ERROR, "Held-out sides")
    first.legend(fontsize=8, frameon=False)
    second.legend(handles=second.lines, fontsize=8, frameon=False)
    second.set_title(f"method {report.method}, {len(sides)} sides", loc="right", fontsize=8, color=_INK)
    return figure


def _histogram(ax: Axes, values: FloatArray, sides: Any, width: float) -> None:
    edges: list[float] = (width * np.arange(np.ceil(values.max() / width + 1e-9) + 1)).tolist()
    parts: Sequence[FloatArray] = [values[sides == "L"], values[sides == "R"]]
    ax.hist(
        parts, edges, stacked=True, color=[LEFT, RIGHT], label=["left", "right"], edgecolor="white", lw=0.8
    )
    mean, median = float(values.mean()), float(np.median(values))
    ax.axvline(mean, color=_INK, lw=1.0, label=f"mean {mean:.2g}")
    ax.axvline(median, color=_INK, lw=1.0, ls="--", label=f"median {median:.2g}")
    ax.set_xlim(0, edges[-1])
    ax.yaxis.set_major_locator(MaxNLocator(integer=True, nbins=6))


def search_curves(report: SearchReport) -> Figure:
    """Draw E_T over the number of training features, and of probe features at the best of these (Figure 5).

    Parameters
    ----------
    report : SearchReport
        What to draw.

    Returns
    -------
    matplotlib Figure
        The figure.
    """
    figure, (first, second) = new_figure(1, 2, (7.0, 3.1))
    curve = report.best.probe_curve
    dropped = [step.dropped or "" for step in report.training]
    _curve(first, [(step.n, step.e_t) for step in report.training], dropped)
    gone = ["", *(next(iter(set(a.features) - set(b.features))) for a, b in pairwise(curve))]
    _curve(second, [(step.n, step.e_t) for step in curve], gone)
    for step in curve:
        if set(step.features) == set(PROBE):
            second.plot(step.n, step.e_t, "o", mfc="none", mec=_INK, ms=9)
            second.annotate(
                f"the paper's {step.n}: {step.e_t:.2f}",
                (step.n, step.e_t),
                (0, -17),
                textcoords="offset points",
                fontsize=8,
                ha="center",
            )
    label(first, "A", "Training features", "Total error $E_T$")
    label(second, "B", f"Touched features, with {report.best.n} training features", "Total error $E_T$")
    return figure


def nested_errors(report: NestedReport) -> Figure:
    """Draw the errors of each side, with features chosen without its animal, over the optimistic ones.

    Parameters
    ----------
    report : NestedReport
        What to draw.

    Returns
    -------
    matplotlib Figure
        The figure.
    """
    figure, (first, second) = new_figure(1, 2, (7.0, 3.3))
    optimistic = {(row.specimen, row.side): row for row in report.optimistic.rows}
    for ax, error, name, letter in (
        (first, "e_ma_deg", AXIS_ERROR, "A"),
        (second, "e_co_mm", ORIGIN_ERROR, "B"),
    ):
        for side, colour, text in (("L", LEFT, "left"), ("R", RIGHT, "right")):
            rows = [row for row in report.rows if row.side == side]
            x = [getattr(optimistic[row.specimen, side], error) for row in rows]
            ax.plot(x, [getattr(row, error) for row in rows], "o", color=colour, ms=5, label=text)
        top = 1.08 * max(getattr(row, error) for row in (*report.rows, *report.optimistic.rows))
        ax.plot([0, top], [0, top], color=_INK, lw=0.8)
        ax.set(xlim=(0, top), ylim=(0, top), aspect="equal")
        ax.xaxis.set_major_locator(MaxNLocator(6))
        ax.yaxis.set_major_locator(MaxNLocator(6))
        label(ax, letter, f"{name},\nchosen on all animals", "chosen without the animal")
    first.legend(fontsize=8, frameon=False, loc="lower right")
    second.set_title(f"method {report.method}", loc="right", fontsize=8, color=_INK)
    return figure


def _curve(ax: Axes, points: Sequence[tuple[int, float]], dropped: Sequence[str]) -> None:
    """Draw a curve with its lowest point marked, and below each point the feature that was dropped for it."""
    n, e_t = zip(*points, strict=True)
    ax.plot(n, e_t, "o-", color=LEFT, lw=1.2, ms=4)
    lowest = min(points, key=lambda point: point[1])
    ax.plot(*lowest, "o", color=ACCENT, ms=6)
    ax.annotate(f"{lowest[1]:.2f}", lowest, (0, -13), textcoords="offset points", fontsize=8, ha="center")
    span = max(e_t) - min(e_t) or 1.0
    ax.set_ylim(min(e_t) - 0.45 * span, max(e_t) + 0.08 * span)
    for position, code in zip(n, dropped, strict=True):
        place: dict[str, Any] = {
            "transform": ax.get_xaxis_transform(),
            "ha": "center",
            "va": "bottom",
            "rotation": 90,
        }
        style = "normal" if code else "italic"
        ax.text(position, 0.02, code or "dropped", fontsize=7, fontstyle=style, color=_INK, **place)
    ax.invert_xaxis()
    ax.set_xticks(range(max(n), min(n) - 1, -2 if len(n) > 12 else -1))


def error_boxes(report: SimulationReport, physical: Sequence[tuple[float, float]] = ()) -> Figure:
    """Draw box plots of both errors on simulated sides, with physical results as circles (Figure 6 C and D).

    Parameters
    ----------
    report : SimulationReport
        What to draw.
    physical : sequence of (float, float)
        E_CO (mm) and E_MA (degrees) of touched skulls.

    Returns
    -------
    matplotlib Figure
        The figure.
    """
    figure, (first, second) = new_figure(1, 2, (7.0, 3.2))
    groups = report.groups
    names = [_SIDES.get(name, name) for name in groups]
    touched = [[skull[1] for skull in physical], [skull[0] for skull in physical]]
    for ax, error, circles in ((first, "e_ma_deg", touched[0]), (second, "e_co_mm", touched[1])):
        _boxes(ax, report, error, 1)
        ax.plot([len(names) + 1] * len(circles), circles, "o", mfc="none", mec=ACCENT, ms=6, mew=1.3)
        shown = [*names, "skulls"] if circles else names
        ax.set_xticks(range(1, len(shown) + 1), shown)
        ax.set_xlim(0.5, len(shown) + 0.5)
        ax.set_ylim(bottom=0)
    label(first, "C", "", AXIS_ERROR)
    label(second, "D", "", ORIGIN_ERROR)
    figure.suptitle(f"method {report.method}, {_simulated(report)}", fontsize=8, color=_INK)
    return figure


def _boxes(ax: Axes, report: SimulationReport, error: str, first: int) -> None:
    """Draw a box for each group of simulated sides, from position `first` on."""
    values = [getattr(errors, error) for errors in report.groups.values()]
    drawn = ax.boxplot(
        values,
        positions=range(first, first + len(values)),
        showfliers=False,
        showmeans=True,
        widths=0.5,
        patch_artist=True,
        medianprops={"color": _INK},
        meanprops={"marker": "D", "mfc": "white", "mec": _INK, "ms": 4},
    )
    for box, colour in zip(drawn["boxes"], (LEFT, RIGHT, "#b8b8b8")[-len(values) :], strict=True):
        box.set(facecolor=colour, alpha=0.75, linewidth=0.8)


def _simulated(report: SimulationReport) -> str:
    n = len(report.groups["pooled"].e_co_mm)
    return f"{n} simulated sides" + (f", noise {report.noise:g} mm" if report.noise else "")


def draw_physical(
    report: PhysicalReport, simulation: SimulationReport | Sequence[SimulationReport] | None = None
) -> Figure:
    """Draw the errors of a touched skull, over those of simulated sides where these are given.

    The boxes are Figure 6 C and D of the paper, one set for each simulated method; the marks of the skull are
    drawn on the box of its method and side.

    Parameters
    ----------
    report : PhysicalReport
        Errors of the skull.
    simulation : SimulationReport or sequence of these, optional
        Of one method each.

    Returns
    -------
    matplotlib Figure
        The figure.
    """
    given = [simulation] if isinstance(simulation, SimulationReport) else list(simulation or ())
    simulations = {each.method: each for each in given}
    methods = list(dict.fromkeys(row.method for row in report.rows))
    figure, (first, second) = new_figure(1, 2, (3.0 + 2.2 * max(len(methods), 2), 3.7))
    for ax, error in ((first, "e_ma_deg"), (second, "e_co_mm")):
        position, ticks = 1, []
        for method in methods:
            found = simulations.get(method)
            names = list(found.groups) if found else [report.side]
            if found:
                _boxes(ax, found, error, position)
            rows = [row for row in report.rows if row.method == method]
            at = names.index(report.side if report.side in names else "pooled")
            _marks(ax, [(row.registration, getattr(row, error)) for row in rows], position + at)
            ticks += [(position + i, _SIDES.get(name, name)) for i, name in enumerate(names)]
            middle = position + (len(names) - 1) / 2
            ax.annotate(
                METHOD_NAMES[method], (middle, 0), (0, -27), xycoords=ax.get_xaxis_transform(),
                textcoords="offset points", ha="center", fontsize=9, color=_INK,
            )  # fmt: skip
            position += len(names) + 1
        ax.set_xticks(*zip(*ticks, strict=True))
        ax.set_xlim(0.3, position - 1.3)
        ax.set_ylim(0, max(ax.get_ylim()[1], 1.08 * max(getattr(row, error) for row in report.rows)))
    label(first, "C", " \n ", AXIS_ERROR)
    label(second, "D", " \n ", ORIGIN_ERROR)
    handles, texts = first.get_legend_handles_labels()
    by_text = dict(zip(texts, handles, strict=True))
    figure.legend(
        by_text.values(), by_text, loc="outside lower center", ncols=3, fontsize=8, frameon=False,
        title="Touched skull, registered to its CT", title_fontsize=8,
    )  # fmt: skip
    if given:
        figure.suptitle(_simulated(given[0]), fontsize=8, color=_INK)
    return figure


def _marks(ax: Axes, found: Sequence[tuple[str, float]], position: float) -> None:
    """Draw one mark a registration beside each other, so that near ones stay apart."""
    for i, (way, value) in enumerate(found):
        shape, text = _WAYS[way]
        x = position + 0.36 * (i - (len(found) - 1) / 2)
        ax.plot(x, value, shape, mfc="white", mec=ACCENT, ms=6, mew=1.4, ls="", label=text, zorder=5)


def comparison(report: ComparisonReport) -> Figure:
    """Draw mean, 95th percentile and maximum of both methods over increasing touch errors.

    Parameters
    ----------
    report : ComparisonReport
        What to draw.

    Returns
    -------
    matplotlib Figure
        The figure.
    """
    figure, axes = new_figure(2, len(PROBES), (9.2, 5.6))
    titles = {"six": "six (the paper's)", "ten": "all ten", "five at random": "five at random"}
    for column, probe in enumerate(PROBES):
        rows = [row for row in report.rows if row.probe == probe]
        for ax, error in ((axes[column], "e_co_mm"), (axes[column + len(PROBES)], "e_ma_deg")):
            _compared(ax, rows, error)
        axes[column].set_title(f"Touched: {titles[probe]}", fontsize=9, color=_INK)
    for name, panels in ((ORIGIN_ERROR, axes[: len(PROBES)]), (AXIS_ERROR, axes[len(PROBES) :])):
        lowest, highest = (pick(ax.get_ylim()[i] for ax in panels) for i, pick in ((0, min), (1, max)))
        for ax in panels:
            ax.set_ylim(lowest, highest)
        panels[0].set_ylabel(name, fontsize=9, color=_INK)
    figure.suptitle(report.animals, fontsize=9, color=_INK)
    axes[0].legend(fontsize=8, frameon=False, loc="upper left")
    figure.supxlabel(
        "Touch errors (mm): Gaussian noise per coordinate, or noise of 0.1 and one displaced touch.   "
        "Dot: mean; bar: to the 95th percentile; cross: maximum",
        fontsize=8,
        color=_INK,
    )
    return figure


def _compared(ax: Axes, rows: Sequence[ComparisonRow], error: str) -> None:
    conditions = list(dict.fromkeys(row.condition for row in rows))
    for method, colour, shift in (("jrmpc", ACCENT, -0.15), ("robust", LEFT, 0.15)):
        found = [row.as_dict()[error] for row in rows if row.method == method]
        x = np.arange(len(conditions)) + shift
        mean, p95, highest = ([summary[key] for summary in found] for key in ("mean", "p95", "max"))
        ax.vlines(x, mean, p95, color=colour, lw=1.6)
        ax.plot(x, mean, "o", color=colour, ms=4.5, label=METHOD_NAMES[method])
        ax.plot(x, highest, "x", color=colour, ms=4, mew=0.9)
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.set_xticks(range(len(conditions)), [_tick(c.noise_mm, c.mistouch_mm) for c in conditions], fontsize=7)
    ax.yaxis.set_major_formatter("{x:g}")
    ax.grid(axis="y", which="major", color=_FAINT, lw=0.6)
    ax.set_axisbelow(True)


def _tick(noise: float, mistouch: float) -> str:
    return f"one off\n{mistouch:g}" if mistouch else f"noise\n{noise:g}"


def label_agreement(report: ReliabilityReport) -> Figure:
    """Draw differences of repeated labels against their mean (Bland and Altman), for each direction.

    Lines are the mean difference and the limits of agreement (mean +- 1.96 SD): solid between observers,
    where there are several, dashed between the rounds of one.

    Parameters
    ----------
    report : ReliabilityReport

    Returns
    -------
    Figure

    References
    ----------
    Bland and Altman, "Statistical methods for assessing agreement", Lancet 327, 1986.
    https://doi.org/10.1016/S0140-6736(86)90837-8
    """
    figure, axes = new_figure(1, 3, (10.0, 3.6))
    for ax, letter, panel in zip(axes, "ABC", agreement_panels(report.differences), strict=False):
        for kind in panel.kinds:
            _draw_agreement(ax, kind)
        way = panel.direction
        label(ax, letter, f"Mean, mm {way} of the atlas", f"Difference, mm {way}")
        ax.axhline(0.0, color=_FAINT, linewidth=0.8, zorder=0)
        ax.set_ylim(-1.08 * panel.largest, 1.08 * panel.largest)
    named = axes[0].get_legend_handles_labels()
    figure.legend(*named, fontsize=8, frameon=False, ncols=2, loc="outside upper center")
    return figure


_KINDS = {False: ("rounds of one observer", RIGHT, "--"), True: ("two observers", LEFT, "-")}


def _draw_agreement(ax: Axes, kind: AgreementKind) -> None:
    name, colour, style = _KINDS[kind.is_inter]
    means, differences = kind.points.T
    ax.scatter(means, differences, s=7, color=colour, alpha=0.55, linewidths=0, label=name)
    for height, width in zip(kind.limits, (1.2, 0.8, 0.8), strict=False):
        ax.axhline(height, color=colour, linewidth=width, linestyle=style)

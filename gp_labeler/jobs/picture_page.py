"""Pages of small pictures under headings, A4 landscape, with places marked in them; the PDF of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gp_core.disk import atomic_file
from gp_core.errors import GpError
from gp_core.landmarks.features import Feature
from gp_labeler.imaging.close_up import PictureAxes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_pdf import PdfPages
    from matplotlib.figure import Figure

    from gp_core.validation import FloatArray

__all__ = [
    "PIXELS",
    "PageLayout",
    "PictureBlock",
    "PictureMark",
    "bone_picture",
    "grey_picture",
    "marked",
    "pdf_file",
    "picture_page",
    "picture_plane",
]

PIXELS = 150
"""Along each side of a picture."""

_GAP, _CAPTION = 8, 50
"""Pixels between the pictures, and above each block for its words."""

_A4_INCHES = (11.69, 8.27)
_BONE = np.array([0.93, 0.88, 0.78])
_PAPER, _EMPTY = 1.0, 0.94
_INK, _QUIET, _ALARM = "#1b1f24", "#4a525b", "#B3261E"
_LOOKS = {"label": ("o", "#D65A00"), "expected": ("D", "#1F9BE0")}
_FAINT = 0.45
_LETTERS = 23
"""That fit above a picture."""


@dataclass(frozen=True)
class PictureMark:
    """A place that is marked in a picture.

    Parameters
    ----------
    picture : int
        Which one of the block, from 0.
    x, y : float
        Pixels from the picture's top left.
    look : str
        ``label`` (a ring) or ``expected`` (a diamond).
    faint : bool
        Whether it lies off the slice.
    """

    picture: int
    x: float
    y: float
    look: str = "label"
    faint: bool = False


@dataclass(frozen=True)
class PictureBlock:
    """Some pictures beside each other, and the words above them.

    Parameters
    ----------
    heading, note : str
        Two lines.
    pictures : (PIXELS, n PIXELS, 3) array, optional
        RGB from 0 to 1; None where there is nothing to show.
    marks : tuple of PictureMark
    captions : tuple of str
        Within each picture, at its foot.
    alarming : bool
        Whether the note is a warning.
    """

    heading: str
    note: str
    pictures: NDArray[np.float32] | None = None
    marks: tuple[PictureMark, ...] = ()
    captions: tuple[str, ...] = ()
    alarming: bool = False


@dataclass(frozen=True)
class PageLayout:
    """How blocks are laid out on a page: columns and rows of blocks, and pictures in each."""

    columns: int
    rows: int
    n_pictures: int

    @property
    def block_size(self) -> tuple[int, int]:
        """Width and height of a block with what is around it, pixels."""
        return self.n_pictures * PIXELS + _GAP, PIXELS + _CAPTION + _GAP

    def corner(self, n: int) -> tuple[int, int]:
        """Return where a block begins, pixels."""
        width, height = self.block_size
        return n % self.columns * width, n // self.columns * height


def picture_plane(row: Feature | None) -> str:
    """Return in which plane a feature is pictured: its best one, or axial where that is no slice."""
    return row.view if row is not None and row.view in ("axial", "coronal", "sagittal") else "axial"


def grey_picture(values: NDArray[np.float32], low: float, high: float) -> NDArray[np.float32]:
    """Return a slice as RGB; black where the scan ends."""
    grey = np.nan_to_num((values - low) / max(high - low, 1e-9)).clip(0, 1)
    return np.repeat(grey[..., None], 3, axis=2).astype(np.float32)


def bone_picture(brightness: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return bone as `CloseUp.bone` has it, tinted, as RGB."""
    found: NDArray[np.float32] = np.where(
        brightness[..., None] > 0, brightness[..., None] * _BONE, _EMPTY
    ).astype(np.float32)
    return found


def marked(
    picture: int,
    position: FloatArray,
    centre: FloatArray,
    axes: PictureAxes,
    across_mm: float,
    look: str = "label",
    *,
    faint: bool = False,
) -> PictureMark:
    """Return the mark of a (3,) scan position in a picture around another one, in the plane of its axes."""
    away, step = position - centre, across_mm / PIXELS
    x, y = (float(away @ np.asarray(axis)) / step + (PIXELS - 1) / 2 for axis in (axes.right, axes.down))
    return PictureMark(picture, x, y, look, faint)


def picture_page(
    blocks: Sequence[PictureBlock], layout: PageLayout, *, title: str, about: str, legend: str
) -> Figure:
    """Lay out blocks as a page, A4 landscape."""
    from matplotlib.figure import Figure  # here: Matplotlib loads slowly

    figure = Figure(figsize=_A4_INCHES, dpi=150)
    axes = figure.add_axes((0.02, 0.015, 0.96, 0.93))
    width, height = layout.block_size
    page = np.full((layout.rows * height, layout.columns * width, 3), _PAPER, np.float32)
    for n, each in enumerate(blocks):
        x, y = layout.corner(n)
        empty = np.full((PIXELS, layout.n_pictures * PIXELS, 3), _EMPTY, np.float32)
        shown = empty if each.pictures is None else each.pictures
        page[y + _CAPTION : y + _CAPTION + PIXELS, x : x + layout.n_pictures * PIXELS] = shown
    axes.imshow(page, interpolation="nearest", aspect="equal")
    axes.set_axis_off()
    axes.set_anchor("N")
    for n, each in enumerate(blocks):
        _write(axes, each, *layout.corner(n), _LETTERS * layout.n_pictures)
    figure.text(0.02, 0.965, title, fontsize=12, fontweight="bold", color=_INK)
    figure.text(0.02, 0.02, legend, fontsize=7.5, color=_QUIET)
    figure.text(0.975, 0.965, about, fontsize=7.5, color=_QUIET, ha="right")
    return figure


def _write(axes: Axes, each: PictureBlock, x: int, y: int, longest: int) -> None:
    axes.text(x, y + 20, each.heading, fontsize=7.5, fontweight="bold", color=_INK)
    note = each.note if len(each.note) <= longest else each.note[: longest - 1] + "…"
    axes.text(x, y + 42, note, fontsize=6.5, color=_ALARM if each.alarming else _QUIET)
    if each.pictures is None:
        return
    for mark in each.marks:
        at = [x + mark.picture * PIXELS + mark.x], [y + _CAPTION + mark.y]
        shape, colour = _LOOKS[mark.look]
        strength = _FAINT if mark.faint else 1.0
        size = 7 if mark.look == "label" else 5.5
        axes.plot(*at, shape, markersize=size, markerfacecolor="none", markeredgecolor=colour, alpha=strength)
        axes.plot(*at, ".", markersize=1.6, color=colour, alpha=strength)
    for n, words in enumerate(each.captions):
        on_paper = n == len(each.captions) - 1 and len(each.captions) > 1
        colour = _QUIET if on_paper else "white"
        axes.text(x + n * PIXELS + 4, y + _CAPTION + PIXELS - 6, words, fontsize=5.5, color=colour)


@contextmanager
def pdf_file(target: Path) -> Iterator[PdfPages]:
    """Write a PDF page by page, and put it in its place once it is whole; raises `GpError`."""
    from matplotlib.backends.backend_pdf import PdfPages

    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise GpError(f"cannot be made ({error.strerror})", file=target.parent) from None
    with atomic_file(target) as draft, PdfPages(draft) as pages:
        yield pages

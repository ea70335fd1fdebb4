"""A synthetic scan of a guinea-pig head with known landmarks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.sampling import draw_animal
from gp_core.disk import atomic_file
from gp_core.errors import GpError
from gp_core.io.markups import write_markups
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import Specimen
from gp_core.validation import FloatArray
from gp_labeler.imaging.progress import Progress, Report
from gp_labeler.imaging.volume import Volume
from gp_labeler.phantom import grey
from gp_labeler.phantom.canvas import Canvas
from gp_labeler.phantom.ear import paint_ear, pinna
from gp_labeler.phantom.jaw import paint_jaw
from gp_labeler.phantom.layout import HeadLayout
from gp_labeler.phantom.loft import skin
from gp_labeler.phantom.skull import (
    paint_arches,
    paint_skin,
    paint_skull,
    paint_upper_teeth,
)

__all__ = ["Phantom", "make_phantom", "write_phantom"]

_SPACINGS_MM = (0.08, 0.5)
_TILT_DEG = 2.0
_BLUR_MM = 0.08
_AIR_MM = 1.5
_N_SOLIDS = 122
"""What a head is painted of; only the progress that is told depends on it."""

_PAINTED = 0.85
"""Share of the time that painting takes; the scanner's blur and noise take the rest."""


@dataclass(frozen=True)
class Phantom:
    """A synthetic scan and the truth about it.

    Parameters
    ----------
    volume : Volume
        Grey values as of a micro-CT, 16 bit.
    specimen : Specimen
        True positions of all 20 features on both sides, frame ``scan``.
    """

    volume: Volume
    specimen: Specimen


def make_phantom(
    seed: int = 0,
    *,
    spacing: float = 0.2,
    box: FloatArray | None = None,
    specimen: Specimen | None = None,
    noise: float = 900.0,
    progress: Progress | None = None,
    cancel: Callable[[], bool] | None = None,
) -> Phantom:
    """Make the synthetic scan of a guinea pig drawn from the published atlas.

    Parameters
    ----------
    seed : int
        The animal and the noise; the same seed gives the same voxels.
    spacing : float
        Voxel size, mm.
    box : (2, 3) array, mm, scan frame, optional
        Make this part only; by default the whole head.
    specimen : Specimen, optional
        Make this animal instead of a drawn one: all 20 features on both sides.
    noise : float
        Standard deviation of the noise in grey values; bone is 22000 above soft tissue.
    progress, cancel : callable, optional
        Told the fraction done; asked whether to stop.

    Returns
    -------
    Phantom

    Raises
    ------
    GpError
        `spacing` is not between 0.08 and 0.5 mm.
    FeatureError
        `specimen` lacks a feature.
    Cancelled
        `cancel` said so.
    """
    if not _SPACINGS_MM[0] <= spacing <= _SPACINGS_MM[1]:
        raise GpError(f"spacing must be {_SPACINGS_MM[0]} to {_SPACINGS_MM[1]} mm, got {spacing!r}")
    rng = np.random.default_rng(seed)
    atlas = Atlas.published()
    animal = specimen or draw_animal(atlas, rng=rng, tilt_deg=_TILT_DEG, name=f"phantom-{seed}")
    head = HeadLayout(animal, atlas)
    low, high = _head_box(head) if box is None else box
    report = Report(progress, cancel)
    painting = report.part(0.0, _PAINTED)
    canvas = Canvas(low, high, spacing, grey.AIR, report=painting, n_solids=_N_SOLIDS)
    _paint(canvas, head)
    voxels = canvas.scanned(rng, blur=_BLUR_MM, noise=noise, report=report.part(_PAINTED, 1.0))
    notes = (f"synthetic head, seed {seed}: no animal was scanned",)
    volume = Volume.from_parts(voxels, [spacing] * 3, canvas.origin, name=animal.name, notes=notes)
    return Phantom(volume, animal)


def _head_box(head: HeadLayout) -> FloatArray:
    """Return the (2, 3) corners of a box in the scan around the whole head, with some air, mm."""
    parts = [skin(head), *(pinna(ear) for ear in head.ears)]
    low = np.min([part.low for part in parts], axis=0)
    high = np.max([part.high for part in parts], axis=0)
    return np.stack([low - _AIR_MM, high + _AIR_MM])


def _paint(canvas: Canvas, head: HeadLayout) -> None:
    paint_skin(canvas, head)
    paint_skull(canvas, head)
    paint_arches(canvas, head)
    paint_upper_teeth(canvas, head)
    for ear in head.ears:
        paint_ear(canvas, ear)
    paint_jaw(canvas, head)


def write_phantom(phantom: Phantom, directory: str | PathLike[str]) -> tuple[Path, Path, Path]:
    """Write a phantom's volume as NRRD and its true landmarks as landmark JSON, one file a side.

    Returns
    -------
    volume, left, right : Path
        ``<name>.nrrd``, ``<name>_L.mrk.json``, ``<name>_R.mrk.json``.

    Raises
    ------
    GpError
        The folder cannot be written to.
    """
    folder = Path(directory)
    name = phantom.specimen.name
    path = folder / f"{name}.nrrd"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _write_volume(phantom.volume, path)
    except (OSError, RuntimeError) as error:
        raise GpError(f"the phantom cannot be written ({error})", file=path) from None
    about = {
        "name": path.name,
        "size": list(phantom.volume.size),
        "spacing": list(phantom.volume.spacing),
        "checksum": phantom.volume.checksum,
    }
    left, right = (folder / f"{name}_{side.value}.mrk.json" for side in Side)
    for side, file in ((Side.LEFT, left), (Side.RIGHT, right)):
        write_markups(file, phantom.specimen.side(side), specimen=name, volume=about)
    return path, left, right


def _write_volume(volume: Volume, path: Path) -> None:
    import SimpleITK

    image: Any = SimpleITK.GetImageFromArray(volume.array)
    image.SetSpacing(volume.spacing)
    image.SetOrigin(volume.origin.tolist())
    image.SetDirection(volume.direction.ravel().tolist())
    with atomic_file(path) as draft:
        try:
            SimpleITK.WriteImage(image, str(draft), useCompression=True)
        except RuntimeError as error:
            raise OSError(str(error).strip().splitlines()[-1]) from None

"""Landmark files of animals that are drawn from an atlas: something to learn and to test with."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np

from gp_core.argument_types import checks_arguments
from gp_core.atlas.atlas import Atlas
from gp_core.atlas.sampling import draw_animal
from gp_core.disk import all_or_none
from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.io.file_names import landmark_file_name
from gp_core.io.markups import write_markups
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.features import FEATURES, PROBE, Side
from gp_core.landmarks.sets import LandmarkSet, Specimen

__all__ = ["draw_labels", "draw_touches"]

_SHARED = tuple(f.code for f in FEATURES if f.shared)
_TILT_DEG = 5.0
_FARTHEST_MM = 300.0


@checks_arguments
def draw_labels(
    directory: str | PathLike[str],
    n: int,
    *,
    atlas: Atlas | None = None,
    observers: Sequence[str] = (),
    rounds: int = 1,
    label_error_mm: float = 0.0,
    seed: int = 0,
    overwrite: bool = False,
) -> list[Path]:
    """Draw animals from an atlas and write them as landmark files, as if they had been labelled.

    Parameters
    ----------
    directory : path-like
        Where to write; created if it is missing.
    n : int
        How many animals, at least 1.
    atlas : Atlas, optional
        With all 19 placed features; the published one by default.
    observers : sequence of str
        Who labels each animal; empty for one unnamed observer.
    rounds : int
        How often each observer labels each animal.
    label_error_mm : float
        Standard deviation of a coordinate of each label about the true point, mm.
    seed : int
        Start of the random numbers: the same files for the same arguments.
    overwrite : bool
        Replace files of the same names.

    Returns
    -------
    list of pathlib.Path
        The written files.

    Raises
    ------
    GpError
        A number is out of its range, the folder cannot be written, or a file is there already.
    """
    if n < 1 or rounds < 1 or label_error_mm < 0 or seed < 0:
        raise GpError("draw needs at least one animal and one round, and no negative number")
    rng = np.random.default_rng(seed)
    source = atlas or Atlas.published()
    animals = [draw_animal(source, rng=rng, tilt_deg=_TILT_DEG, name=f"drawn{i + 1:02}") for i in range(n)]
    files: dict[Path, tuple[str, LandmarkSet]] = {}
    for animal in animals:
        for observer, round_ in _labellings(observers, rounds):
            for side, landmarks in _labelled(animal, label_error_mm, rng).items():
                named = round_ if observers or rounds > 1 else None
                name = landmark_file_name(animal.name, side, observer=observer, round_=named)
                made = replace(landmarks, observer=observer, round=round_)
                files[Path(directory) / name] = (animal.name, made)
    _write(Path(directory), files, overwrite)
    return list(files)


@checks_arguments
def draw_touches(
    *, atlas: Atlas | None = None, touch_error_mm: float = 0.1, seed: int = 0
) -> tuple[LandmarkSet, LandmarkSet]:
    """Draw an animal from an atlas and touch the paper's six features of its left ear with a probe.

    Parameters
    ----------
    atlas : Atlas, optional
        With all 19 placed features; the published one by default.
    touch_error_mm : float
        Standard deviation of a coordinate of each touch, mm.
    seed : int
        Start of the random numbers.

    Returns
    -------
    touches, truth : LandmarkSet
        The touches, and all 20 features; frame ``tracker``, mm.

    Raises
    ------
    GpError
        A number is negative.
    """
    from scipy.spatial.transform import Rotation  # takes long to import: only where it is needed

    if touch_error_mm < 0 or seed < 0:
        raise GpError("draw needs no negative number")
    rng = np.random.default_rng([seed, 1])  # another animal than those of `draw_labels`
    left = draw_animal(atlas or Atlas.published(), rng=rng).sides[Side.LEFT]
    T_tracker_scan = RigidTransform.from_parts(
        Rotation.random(random_state=rng).as_matrix(),
        rng.uniform(-_FARTHEST_MM, _FARTHEST_MM, 3),
        dst="tracker",
        src="scan",
    )
    truth = left.moved(T_tracker_scan)
    touched = {code: truth[code] + touch_error_mm * rng.standard_normal(3) for code in PROBE}
    return LandmarkSet.from_mapping(touched, Side.LEFT, frame="tracker"), truth


def _labellings(observers: Sequence[str], rounds: int) -> Iterator[tuple[str, int]]:
    for observer in observers or ("",):
        for round_ in range(1, rounds + 1):
            yield observer, round_


def _labelled(animal: Specimen, error_mm: float, rng: np.random.Generator) -> dict[Side, LandmarkSet]:
    """Return the sides of an animal as labelled with errors; features that both sides share have the same."""
    shared = {code: error_mm * rng.standard_normal(3) for code in _SHARED}
    sides = {}
    for side, landmarks in animal.sides.items():
        points = {f.code: landmarks[f.code] for f in FEATURES if not f.computed}
        errors = {code: shared.get(code, error_mm * rng.standard_normal(3)) for code in points}
        named = {code: point + errors[code] for code, point in points.items()}
        sides[side] = with_cochlea_origin(LandmarkSet.from_mapping(named, side, frame="scan"))
    return sides


def _write(folder: Path, files: dict[Path, tuple[str, LandmarkSet]], overwrite: bool) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise GpError(f"cannot be made a folder ({error})", file=folder, remedy="Name another.") from None
    if not overwrite and (there := next((file for file in files if file.exists()), None)):
        remedy = "Name an empty folder, or replace what is there (--replace)."
        raise GpError("already exists", file=there, remedy=remedy)
    with all_or_none():
        for file, (name, landmarks) in files.items():
            provenance = {code: {"method": "drawn"} for code in landmarks.placed}
            write_markups(file, landmarks, specimen=name, provenance=provenance)

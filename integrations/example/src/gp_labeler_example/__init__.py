"""An example of a package that extends gp-labeler; docs/extensions.md explains it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gp_core import Atlas, CochleaPose, Finding, GpError, LandmarkSet, Status
from gp_core.io import LabelledPoint, PointList
from gp_core.pose.estimate import EstimatorInput
from gp_core.pose.robust import estimate_robust

if TYPE_CHECKING:
    from gp_labeler.imaging.readers.added import ScanData


def read_xyz(path: str | Path) -> PointList:
    """Read points, one a line: name, x, y, z, separated by spaces; mm, LPS."""
    points = []
    for number, line in enumerate(Path(path).read_text(encoding="utf-8").splitlines(), start=1):
        try:
            name, x, y, z = line.split()
            position = np.array([float(x), float(y), float(z)])
            points.append(LabelledPoint(name, position, Status.PLACED))
        except ValueError:
            raise GpError(f"line {number} is not: name x y z", file=path, remedy="Correct it.") from None
    return PointList(tuple(points), Path(path))


def estimate_by_centroid(given: EstimatorInput) -> CochleaPose:
    """Estimate as the robust method does, but let nobody send it to a robot: it is an example."""
    assert given.atlas is not None
    pose = estimate_robust(given.touches, given.atlas, shared_error=given.shared_error)
    return replace(pose, warnings=(*pose.warnings, "an example, not a method"))


def find_round_numbers(landmarks: LandmarkSet, atlas: Atlas) -> Iterator[Finding]:
    """Find labels whose three coordinates are whole millimetres, as typed by hand."""
    for code in landmarks.placed:
        position = landmarks[code]
        if (position == np.round(position)).all():
            text, remedy = f"{code} lies at whole millimetres", f"Place {code} again, by a click."
            yield Finding("", landmarks.side, "round", (code,), text, remedy)


def find_unsigned(landmarks: LandmarkSet, atlas: Atlas) -> Iterator[Finding]:
    """Find labels of which nobody knows who placed them."""
    if landmarks.placed and not landmarks.observer:
        text, remedy = "nobody is named who placed these labels", "Enter who labels, and save again."
        yield Finding("", landmarks.side, "unsigned", (), text, remedy)


def read_npyscan(path: Path) -> ScanData:
    """Read a scan from NumPy's ``.npz`` format under another name: ``values`` and ``spacing``."""
    from gp_labeler.imaging.readers.added import ScanData

    with np.load(path, allow_pickle=False) as content:
        x, y, z = (float(length) for length in content["spacing"])
        return ScanData(content["values"], (x, y, z))

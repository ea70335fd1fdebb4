"""Landmarks of gp-labeler and 3D Slicer as points layers of napari, and back.

napari's axes are z, y, x. Landmarks are millimetres in LPS; a points layer holds them as (z, y, x) in mm. So
show a scan with its voxel size as `scale` and its origin as `translate`. Names and sides are features of the
layer: ``label`` and ``side``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

import gp_core
from gp_core.io import read_points, write_fcsv, write_markups
from gp_labeler.document.specimen_file import read_specimen

__all__ = ["get_reader", "read_file", "write_points"]

Layer = tuple[Any, dict[str, Any], str]
_ENDINGS = (".mrk.json", ".fcsv", ".gpspecimen.json")


def get_reader(path: str | Sequence[str]) -> Callable[[str], list[Layer]] | None:
    """Return the reader for a path, or None where it is not for us."""
    first = path if isinstance(path, str) else path[0]
    return read_file if first.lower().endswith(_ENDINGS) else None


def read_file(path: str | PathLike[str] | Sequence[str]) -> list[Layer]:
    """Return the points layers of a file: one for each side that it has."""
    file = Path(path[0] if isinstance(path, list | tuple) else path)  # type: ignore[arg-type]
    if fspath(file).lower().endswith(".gpspecimen.json"):
        state = read_specimen(file)
        return [_side_layer(state.side(side), f"{state.specimen}_{side.value}") for side in gp_core.Side]
    points = read_points(file)
    placed = [point for point in points.points if point.position is not None]
    labels = [point.label for point in placed]
    sides = [point.side.value if point.side else "" for point in placed]
    return [_layer(labels, sides, [point.position for point in placed], file.name.partition(".")[0])]


def _side_layer(landmarks: gp_core.LandmarkSet, name: str) -> Layer:
    placed = landmarks.placed
    return _layer(list(placed), [landmarks.side.value] * len(placed), [landmarks[c] for c in placed], name)


def _layer(labels: list[str], sides: list[str], positions: list[Any], name: str) -> Layer:
    data = np.array([position[::-1] for position in positions]).reshape(-1, 3)
    features = {"label": labels, "side": sides}
    text = {"string": "{label}", "size": 10, "translation": [0, 0, 0.5]}
    return (
        data,
        {"name": name, "features": features, "text": text, "size": 0.5, "face_color": "#e69f00"},
        "points",
    )


def write_points(path: str, data: Any, meta: dict[str, Any]) -> list[str]:
    """Write one points layer: names are its feature ``label``, the side is that in the file's name."""
    labels = [str(label) for label in meta.get("features", {}).get("label", ())]
    if len(labels) != len(data):
        raise gp_core.GpError("the layer has no names", file=path, remedy="Give it the feature 'label'.")
    file = Path(path)
    stem = file.name.partition(".")[0]
    if not stem.endswith(("_L", "_R")):
        raise gp_core.GpError("the name does not say the side", file=path, remedy="Let it end in _L or _R.")
    points = {label: np.asarray(row, float)[::-1] for label, row in zip(labels, data, strict=True)}
    landmarks = gp_core.LandmarkSet.from_mapping(points, stem[-1], frame="scan")
    if file.name.lower().endswith(".fcsv"):
        write_fcsv(file, landmarks)
    else:
        write_markups(file, landmarks, specimen=stem[:-2])
    return [path]

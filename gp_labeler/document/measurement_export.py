"""Writing rulers and angles into files that 3D Slicer reads."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from gp_core.io import write_measurements
from gp_labeler.document.specimen_json import volume_document
from gp_labeler.document.state import SpecimenState

__all__ = ["export_measurements"]


def export_measurements(
    state: SpecimenState, folder: str | PathLike[str], *, overwrite: bool = False
) -> tuple[Path, ...]:
    """Write all rulers and angles of a specimen, a file each; see `write_measurements` for what it raises."""
    volume = None if state.volume is None else volume_document(state.volume)
    if volume is not None:
        volume.pop("path", None)  # of no use to others, and nobody's business
    return write_measurements(
        folder, state.measurements, specimen=state.specimen, volume=volume, overwrite=overwrite
    )

"""The log that SkyScan / Bruker's NRecon leaves beside its slices."""

from __future__ import annotations

import codecs
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gp_labeler.imaging.readers.options import Spacing
from gp_labeler.imaging.readers.plan import Geometry
from gp_labeler.imaging.readers.problems import Problem, warning
from gp_labeler.imaging.readers.spacing import shown, unit_in_mm

__all__ = ["SkyScanLog", "find_log", "log_geometry", "read_log"]

_ACQUISITION, _RECONSTRUCTION = "acquisition", "reconstruction"
_PIXEL = re.compile(r"(?:image )?pixel size \((.+)\)")
_SAME_FACTOR = 0.02
_MOST_BYTES = 1 << 20


@dataclass(frozen=True)
class SkyScanLog:
    """What the section ``[Reconstruction]`` of a log says; None where it does not.

    Parameters
    ----------
    path : Path
        The log.
    pixel_mm : float, mm, optional
        Voxel size on all axes.
    prefix : str
        How the names of the slices begin.
    width, height : int, optional
        Pixels of a slice.
    first, last : int, optional
        Numbers of the slices.
    step : int
        Sections from one slice to the next.
    projection_mm : float, mm, optional
        Pixel size of the projections: what the slices may have, where the log does not say it of them.
    """

    path: Path
    pixel_mm: float | None
    prefix: str
    width: int | None
    height: int | None
    first: int | None
    last: int | None
    step: int = 1
    projection_mm: float | None = None

    @property
    def n_sections(self) -> int | None:
        """How many slices it speaks of."""
        if self.first is None or self.last is None:
            return None
        return (self.last - self.first) // self.step + 1


def read_log(path: Path) -> SkyScanLog | None:
    """Read a log; None if it has no section ``[Reconstruction]``.

    Only that section counts: ``[Acquisition]`` holds other pixel sizes (camera, projection, scaled) and
    another file name prefix.
    """
    with path.open("rb") as file:
        raw = file.read(_MOST_BYTES)
    text = _decoded(raw)
    sections: dict[str, dict[str, str]] = {_ACQUISITION: {}, _RECONSTRUCTION: {}}
    fields: dict[str, str] = {}
    for line in text.splitlines():
        stripped = line.strip()
        if stripped.startswith("[") and stripped.endswith("]"):
            fields = sections.setdefault(stripped[1:-1].strip().lower(), {})
        elif "=" in stripped:
            name, _, value = stripped.partition("=")
            fields.setdefault(" ".join(name.lower().split()), value.strip())
    fields = sections[_RECONSTRUCTION]
    if not fields:
        return None
    return SkyScanLog(
        path,
        _pixel_mm(fields),
        fields.get("filename prefix", ""),
        _whole(fields.get("result image width (pixels)")),
        _whole(fields.get("result image height (pixels)")),
        _whole(fields.get("first section")),
        _whole(fields.get("last section")),
        max(1, _whole(fields.get("section to section step")) or 1),
        _pixel_mm(sections[_ACQUISITION]),
    )


def _decoded(raw: bytes) -> str:
    """Return the text of a log: Windows programs write UTF-16, UTF-8 or their own 8-bit letters."""
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return raw.decode("utf-16", "replace")
    if b"\0" in raw[:2]:
        return raw.decode("utf-16-be" if raw[:1] == b"\0" else "utf-16-le", "replace")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _pixel_mm(fields: dict[str, str]) -> float | None:
    for name, value in fields.items():
        found = _PIXEL.fullmatch(name)
        number, unit = _number(value), unit_in_mm(found[1]) if found else None
        if number is not None and number > 0 and unit is not None:
            return number * unit
    return None


def find_log(folder: Path, prefix: str) -> SkyScanLog | None:
    """Return the log of the slices whose names begin with `prefix`; one that names others does not count."""
    logs = [
        log
        for path in sorted(folder.glob("*"))
        if path.suffix.lower() == ".log" and path.is_file() and (log := read_log(path))
    ]
    named = [log for log in logs if log.prefix and prefix.lower().startswith(log.prefix.lower())]
    if named:
        return max(named, key=lambda log: len(log.prefix))
    stems = [log for log in logs if prefix.lower().startswith(log.path.stem.lower())]
    if stems:
        return stems[0]
    return logs[0] if len(logs) == 1 else None


def log_geometry(
    log: SkyScanLog, pattern: str, numbers: Sequence[int], step: int, shape: tuple[int, int]
) -> tuple[Geometry, list[Problem]]:
    """Return what a log says of where the voxels of its slices lie, and where it does not fit them.

    Parameters
    ----------
    log : SkyScanLog
        The log.
    pattern : str
        Names of the slices, with ``#`` for the number.
    numbers : sequence of int
        In the names of the slices.
    step : int
        From one number to the next.
    shape : (rows, columns)
        Pixels of a slice.
    """
    mm = log.pixel_mm
    if mm is None:
        hint = log.projection_mm
        reason = f"{log.path.name} does not give the pixel size of the slices, only that of the projections"
        if hint is None:
            return Geometry(sides_known=False), []
        return Geometry(sides_known=False, suggested=(hint, hint, hint * step), reason=reason), []
    found = _warnings(log, pattern, numbers)
    n_slices = (max(numbers) - min(numbers)) // step + 1
    size = f"{shape[1]} x {shape[0]}"
    if log.width and log.height and (log.height, log.width) != shape:
        reason = (
            f"{log.path.name} states {log.width} x {log.height} pixels, the slices have {size}: "
            f"if they were made smaller, its voxel size of {shown((mm,))} is wrong for them"
        )
        suggested = _shrunk(log, mm, shape, step)
        return Geometry(sides_known=False, suggested=suggested, reason=reason), found
    sections, reason = _sections_apart(log, numbers, step, n_slices)
    spacing = (mm, mm, mm * sections)
    if reason:
        return Geometry(sides_known=False, suggested=spacing, reason=reason), found
    return Geometry(spacing, sides_known=False), found


def _warnings(log: SkyScanLog, pattern: str, numbers: Sequence[int]) -> list[Problem]:
    found = []
    if log.prefix and not pattern.lower().startswith(log.prefix.lower()):
        text = f"{log.path.name} states slices {log.prefix}..., these are {pattern}; the log is used"
        found.append(warning("log-prefix", text))
    ends = (min(numbers), max(numbers))
    if log.n_sections is not None and ends != (log.first, log.last):
        text = f"{log.path.name} states slices {log.first} to {log.last}, there are {ends[0]} to {ends[1]}"
        found.append(warning("log-sections", text))
    return found


def _shrunk(log: SkyScanLog, mm: float, shape: tuple[int, int], step: int) -> Spacing:
    """Return the voxel size of a scan that was made smaller by one factor on all axes, if it was."""
    across, down = (log.width or 0) / shape[1], (log.height or 0) / shape[0]
    if abs(across / down - 1) > _SAME_FACTOR:
        return mm, mm, mm * step
    factor = round(across) if abs(across - round(across)) < _SAME_FACTOR * across else across
    return mm * factor, mm * factor, mm * factor


def _sections_apart(log: SkyScanLog, numbers: Sequence[int], step: int, n_slices: int) -> tuple[int, str]:
    """Return how many sections lie from one slice to the next, and why that is a guess, if it is.

    NRecon names slices by their sections. Other programs number them again, from 0 or 1.
    """
    there = f"there are {n_slices}, numbered {min(numbers)} to {max(numbers)}"
    said = f"{log.path.name} states every {log.step}. section from {log.first} to {log.last}; {there}"
    if log.n_sections is None:
        return max(step, log.step), said if log.step not in (1, step) else ""
    if step == 1 and n_slices == log.n_sections:
        return log.step, ""
    fewer = round(log.n_sections / n_slices)
    if step == 1 and fewer > 1 and abs(log.n_sections - fewer * n_slices) < fewer:
        return fewer * log.step, f"{said}: some of them may have been removed"
    return max(step, log.step), said if step % log.step else ""


def _number(text: str | None) -> float | None:
    try:
        return None if text is None else float(text.replace(",", "."))
    except ValueError:
        return None


def _whole(text: str | None) -> int | None:
    number = _number(text)
    return None if number is None else round(number)

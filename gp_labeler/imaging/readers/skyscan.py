"""The log that SkyScan / Bruker's NRecon leaves beside its slices."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

__all__ = ["SkyScanLog", "find_log", "read_log"]

_RECONSTRUCTION = "reconstruction"


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
    """

    path: Path
    pixel_mm: float | None
    prefix: str
    width: int | None
    height: int | None
    first: int | None
    last: int | None


def read_log(path: Path) -> SkyScanLog | None:
    """Read a log; None if it has no section ``[Reconstruction]``.

    Only that section counts: ``[Acquisition]`` holds other pixel sizes (camera, projection, scaled) and
    another file name prefix.
    """
    raw = path.read_bytes()
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    fields: dict[str, str] = {}
    section = ""
    for line in text.splitlines():
        stripped = line.strip()
        if stripped.startswith("[") and stripped.endswith("]"):
            section = stripped[1:-1].strip().lower()
        elif section == _RECONSTRUCTION and "=" in stripped:
            name, _, value = stripped.partition("=")
            fields.setdefault(" ".join(name.lower().split()), value.strip())
            fields.setdefault("", "seen")
    if not fields:
        return None
    pixel_um = _number(fields.get("pixel size (um)") or fields.get("pixel size (µm)"))
    return SkyScanLog(
        path,
        None if pixel_um is None or pixel_um <= 0 else pixel_um / 1000,
        fields.get("filename prefix", ""),
        _whole(fields.get("result image width (pixels)")),
        _whole(fields.get("result image height (pixels)")),
        _whole(fields.get("first section")),
        _whole(fields.get("last section")),
    )


def find_log(folder: Path, prefix: str) -> SkyScanLog | None:
    """Return the log of the slices whose names begin with `prefix`; one that names others does not count."""
    logs = [
        log for path in sorted(folder.glob("*")) if path.suffix.lower() == ".log" and (log := read_log(path))
    ]
    named = [log for log in logs if log.prefix and prefix.lower().startswith(log.prefix.lower())]
    if named:
        return max(named, key=lambda log: len(log.prefix))
    stems = [log for log in logs if prefix.lower().startswith(log.path.stem.lower())]
    if stems:
        return stems[0]
    return logs[0] if len(logs) == 1 else None


def _number(text: str | None) -> float | None:
    try:
        return None if text is None else float(text.replace(",", "."))
    except ValueError:
        return None


def _whole(text: str | None) -> int | None:
    number = _number(text)
    return None if number is None else round(number)

"""Labelled scans on disk: landmark files or specimens, and the scan that each was labelled on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

from gp_core.errors import FileFormatError, GpError
from gp_core.frames import RigidTransform
from gp_core.io import (
    PointList,
    load_specimens,
    natural_key,
    read_points,
    sides_of,
    specimen_of,
    unknown_labels,
)
from gp_core.landmarks.features import Side
from gp_core.landmarks.labels import tidy_label
from gp_core.landmarks.sets import Status
from gp_core.validation import FloatArray
from gp_labeler.autolabel.labelled_scan import FEWEST_LANDMARKS, LabelledScan, flat_points
from gp_labeler.document.animals import Skipped, labelled_files
from gp_labeler.document.specimen_file import SUFFIX, read_specimen
from gp_labeler.imaging.readers.formats import is_readable_name, volume_kind, volume_stem

__all__ = ["LabelledScans", "placed_points", "read_labelled_scans", "scans_at"]


@dataclass(frozen=True)
class LabelledScans:
    """What was found.

    Parameters
    ----------
    scans : tuple of LabelledScan
        By name, GP2 before GP10.
    skipped : tuple of Skipped
        What cannot be used, and why.
    """

    scans: tuple[LabelledScan, ...]
    skipped: tuple[Skipped, ...] = ()


def read_labelled_scans(paths: Iterable[str | PathLike[str]]) -> LabelledScans:
    """Find labelled scans in folders, and among specimen files and landmark files.

    A specimen file (``.gpspecimen.json``) names its scan. The scan of a landmark file lies beside it under
    the specimen's name: ``GP-014.nrrd`` or a folder ``GP-014`` for ``GP-014_L.mrk.json``. Landmarks may be
    of any scheme; only what a person has placed or confirmed counts.

    Parameters
    ----------
    paths : iterable of path
        Folders (not searched deeper) and files.

    Returns
    -------
    LabelledScans

    Raises
    ------
    GpError
        A file cannot be read, or there is not one labelled scan.
    """
    files = list(dict.fromkeys(file for path in paths for file in _files_at(Path(path))))
    finding = _Finding()
    for file in files:
        if file.name.endswith(SUFFIX):
            finding.take_specimen(file)
    finding.take_landmarks([file for file in files if not file.name.endswith(SUFFIX)])
    if not finding.scans:
        why = "; ".join(f"{each.what}: {each.why}" for each in finding.skipped[:3])
        raise GpError(
            f"there is no labelled scan among {len(files)} files{': ' if why else ''}{why}",
            remedy="Keep each scan beside its landmark files, under the specimen's name.",
        )
    ordered = sorted(finding.scans.values(), key=lambda scan: natural_key(scan.name))
    return LabelledScans(tuple(ordered), tuple(finding.skipped))


@dataclass
class _Finding:
    """The labelled scans found so far."""

    scans: dict[str, LabelledScan] = field(default_factory=dict)
    skipped: list[Skipped] = field(default_factory=list)

    def take_specimen(self, file: Path) -> None:
        """Take in a specimen that was saved."""
        state = read_specimen(file)
        points = flat_points({side: state.side(side) for side in Side})
        volume = state.volume
        path = None if volume is None or volume.path is None else Path(volume.path)
        head = None if state.head_frame is None else state.head_frame.T_head_scan
        self._take(state.specimen, points, path, file, dict(state.import_choices), head)

    def take_landmarks(self, files: list[Path]) -> None:
        """Take in landmark files, the sides of an animal together."""
        of_features: dict[str, list[Path]] = {}
        for file in files:
            read = read_points(file)
            name = specimen_of(read)
            if name in self.scans:
                continue  # exported from a specimen file that was read
            if unknown_labels(read):
                self._take(name, _placed(read), _scan_of(read, name), file, {})
            else:
                of_features.setdefault(name, []).append(file)
        for name, own in of_features.items():
            points: dict[str, FloatArray] = {}
            for specimen in load_specimens(own):
                if any(landmarks.frame != "scan" for landmarks in specimen.sides.values()):
                    self.skipped.append(Skipped(name, "its landmarks are not in the scan frame"))
                    continue
                points |= flat_points(specimen.sides)
            if points:
                self._take(name, points, _scan_of(read_points(own[0]), name), own[0], {})

    def _take(
        self,
        name: str,
        points: Mapping[str, FloatArray],
        path: Path | None,
        file: Path,
        options: Mapping[str, object],
        head: RigidTransform | None = None,
    ) -> None:
        if name in self.scans:
            self.skipped.append(Skipped(file.name, f"{name} already exists"))
        elif len(points) < FEWEST_LANDMARKS:
            self.skipped.append(Skipped(file.name, f"{len(points)} points are placed"))
        elif path is None or not path.exists():
            self.skipped.append(Skipped(file.name, "its scan is not there"))
        else:
            self.scans[name] = LabelledScan(name, dict(points), path, options, T_head_scan=head)


def _placed(read: PointList) -> dict[str, FloatArray]:
    """Return the placed points of a file by label, with the side where a point tells one."""
    found: dict[str, FloatArray] = {}
    for point in read.points:
        if point.position is None or point.status is not Status.PLACED:
            continue
        label = tidy_label(point.label)
        name = label if point.side is None else f"{label}_{point.side.value}"
        if name in found:
            raise FileFormatError("is in the file twice", file=read.source, landmark=name[:40])
        found[name] = point.position
    return found


def placed_points(files: Iterable[str | PathLike[str]]) -> dict[str, FloatArray]:
    """Return the placed landmarks of files by name, features of the guinea pig with their side.

    Raises
    ------
    GpError
        A file cannot be read, or says no side for features that have one.
    """
    found: dict[str, FloatArray] = {}
    for file in files:
        read = read_points(file)
        if unknown_labels(read):
            found |= _placed(read)
        else:
            found |= flat_points({landmarks.side: landmarks for landmarks in sides_of(read)})
    return found


def _scan_of(read: PointList, name: str) -> Path | None:
    """Return the scan that a landmark file was placed on: as its header says, else by the specimen's name."""
    folder = read.source.absolute().parent
    volume = read.header.volume if read.header else None
    said = str(volume.get("name", "")) if volume else ""
    if said and (folder / Path(said).name).is_file():
        return folder / Path(said).name
    wanted = {name.casefold(), volume_stem(Path(said)).casefold()} - {""}
    beside = [
        path
        for path in sorted(folder.iterdir())
        if (path.is_dir() and path.name.casefold() in wanted)
        or (path.is_file() and is_readable_name(path) and volume_stem(path).casefold() in wanted)
    ]
    return beside[0] if beside else None


def _files_at(path: Path) -> list[Path]:
    if not path.exists():
        raise GpError("does not exist", file=path, remedy="Give a folder of labelled scans.")
    found = list(labelled_files(path)) if path.is_dir() else [path]
    return [file for file in found if "suggested" not in file.name.lower()]


def scans_at(path: Path) -> list[Path]:
    """Return the scans of a folder of scans, or the file or folder itself where it is one scan.

    Raises
    ------
    GpError
        There is nothing.
    """
    if not path.exists():
        raise GpError("does not exist", file=path, remedy="Give a scan, or a folder of scans.")
    if not path.is_dir():
        return [path]
    files = [file for file in path.iterdir() if file.is_file() and volume_kind(file) is not None]
    return sorted(files, key=lambda file: natural_key(file.name)) or [path]

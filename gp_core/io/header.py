"""The ``gpLabeler`` object: what this program adds to a markups file of 3D Slicer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

from gp_core.errors import FeatureError, FileFormatError, GpError
from gp_core.frames import FRAMES
from gp_core.io.text import shown
from gp_core.landmarks.features import Side
from gp_core.landmarks.scan_evidence import ScanEvidence

__all__ = ["SCHEMA_VERSION", "FileHeader"]

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class FileHeader:
    """Whose landmarks a file holds, of what, and how they came to be.

    Parameters
    ----------
    specimen : str, optional
        Name of the animal.
    side : Side, optional
        Side of the head.
    frame : str
        Frame of the positions.
    volume : mapping, optional
        Name, size, spacing and checksum of the volume that was labelled.
    provenance : mapping of str to any
        By label: how the point came to be, in plain JSON values.
    extra : tuple of str
        Labels beside the feature table that belong in the file.
    scan_evidence : ScanEvidence, optional
        How far the points are from bone, as measured in the scan.
    observer : str, optional
        Who placed them; None where nobody said.
    round : int
        Which of the observer's labellings of this side it is, from 1.
    """

    specimen: str | None = None
    side: Side | None = None
    frame: str = "scan"
    volume: Mapping[str, Any] | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    extra: tuple[str, ...] = ()
    scan_evidence: ScanEvidence | None = None
    observer: str | None = None
    round: int = 1

    def as_json(self) -> dict[str, Any]:
        """Return the object as the file holds it.

        Returns
        -------
        dict
            Plain values for JSON.
        """
        content = {
            "schemaVersion": SCHEMA_VERSION,
            "specimen": self.specimen,
            "side": None if self.side is None else self.side.value,
            "observer": self.observer,
            "round": self.round,
            "frame": self.frame,
            "volume": None if self.volume is None else dict(self.volume),
            "provenance": dict(self.provenance),
            "extra": list(self.extra),
        }
        if self.scan_evidence is not None:
            content["boneDistanceMm"] = self.scan_evidence.as_json()
        return content

    @classmethod
    def from_json(cls, value: object, file: str | PathLike[str]) -> FileHeader:
        """Build a header from the file's object; absent fields keep their defaults.

        Parameters
        ----------
        value : object
            A list of the parsed object, or, as in files of earlier versions, the object itself.
        file : path-like
            For messages.

        Returns
        -------
        FileHeader
            The header.

        Raises
        ------
        FileFormatError
            Not such an object, or of a later schema.
        """
        if isinstance(value, list) and len(value) == 1:
            (value,) = value
        got: dict[str, Any] = value if isinstance(value, dict) else {"specimen": value}
        version = got.get("schemaVersion", SCHEMA_VERSION)
        if isinstance(version, int) and version > SCHEMA_VERSION:
            raise FileFormatError(
                f"has a gpLabeler object of schema version {shown(version)}; up to {SCHEMA_VERSION} is known",
                file=file,
                remedy="Update gp-labeler.",
            )
        header = cls(
            specimen=got.get("specimen"),
            side=_side(got.get("side"), file),
            frame=got.get("frame", "scan"),
            volume=got.get("volume"),
            provenance=got.get("provenance", {}),
            extra=tuple(got["extra"]) if isinstance(got.get("extra"), list) else (),
            scan_evidence=_scan_evidence(got.get("boneDistanceMm"), file),
            observer=got.get("observer"),
            round=1 if got.get("round") is None else got["round"],
        )
        wrong = header._wrong_field()
        if wrong:
            raise FileFormatError(
                f"its gpLabeler object has a wrong {wrong}, {shown(got.get(wrong))}",
                file=file,
                remedy="Correct it, or remove the object.",
            )
        return header

    def _wrong_field(self) -> str | None:
        checks = {
            "specimen": self.specimen is None
            or (isinstance(self.specimen, str) and bool(self.specimen.strip())),
            "frame": self.frame in FRAMES,
            "observer": self.observer is None or isinstance(self.observer, str),
            "round": isinstance(self.round, int)
            and not isinstance(self.round, bool)
            and 0 < self.round < 10_000,  # as in the name of a file
            "volume": self.volume is None or isinstance(self.volume, dict),
            "provenance": isinstance(self.provenance, dict),
            "extra": all(isinstance(label, str) for label in self.extra),
        }
        return next((name for name, proper in checks.items() if not proper), None)


def _side(value: object, file: str | PathLike[str]) -> Side | None:
    try:
        return None if value is None else Side.parse(str(value))
    except FeatureError:
        raise FileFormatError(
            f"its gpLabeler object has a wrong side, {shown(value)}", file=file, remedy="Write L or R."
        ) from None


def _scan_evidence(value: object, file: str | PathLike[str]) -> ScanEvidence | None:
    try:
        return None if value is None else ScanEvidence.from_json(value)
    except GpError as error:
        raise FileFormatError(
            f"its gpLabeler object has a wrong boneDistanceMm ({error.problem})",
            file=file,
            remedy="Export the landmarks again, or remove the entry.",
        ) from None

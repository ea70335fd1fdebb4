"""The scan that a specimen was labelled on, remembered without its voxels."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike, fspath
from typing import Protocol

__all__ = ["VolumeLike", "VolumeReference"]


class VolumeLike(Protocol):
    """What a document needs to know of a volume; `gp_labeler.imaging.volume.Volume` is one."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def size(self) -> tuple[int, int, int]: ...  # noqa: D102
    @property
    def spacing(self) -> tuple[float, float, float]: ...  # noqa: D102
    @property
    def checksum(self) -> str: ...  # noqa: D102
    @property
    def path(self) -> str | PathLike[str] | None: ...  # noqa: D102


@dataclass(frozen=True)
class VolumeReference:
    """The scan that a specimen was labelled on, without its voxels.

    Parameters
    ----------
    name : str
        Name of the scan.
    size : (3,) tuple of int
        Voxels along i, j, k.
    spacing : (3,) tuple of float
        Voxel size, mm.
    checksum : str
        Of the voxels and the geometry; empty where unknown.
    path : str, optional
        File or folder.
    """

    name: str
    size: tuple[int, int, int]
    spacing: tuple[float, float, float]
    checksum: str = ""
    path: str | None = None

    @classmethod
    def of(cls, volume: VolumeLike) -> VolumeReference:
        """Make the reference of a loaded volume; without a checksum where that is not known yet."""
        i, j, k = (int(n) for n in volume.size)
        x, y, z = (float(s) for s in volume.spacing)
        path = None if volume.path is None else fspath(volume.path)
        checksum = volume.known_checksum if hasattr(volume, "known_checksum") else volume.checksum
        return cls(str(volume.name), (i, j, k), (x, y, z), str(checksum), path)

    def differences(self, other: VolumeReference) -> tuple[str, ...]:
        """Say, a clause each, in what `other` is another scan than this one; its place does not count."""
        found = []
        if self.size != other.size:
            found.append(f"it has {_times(other.size)} voxels, the labelled one {_times(self.size)}")
        if any(abs(a - b) > 1e-6 * abs(a) for a, b in zip(self.spacing, other.spacing, strict=True)):
            found.append(
                f"its voxels are {_times(other.spacing)} mm, the labelled one's {_times(self.spacing)} mm"
            )
        if not found and self.checksum and other.checksum and self.checksum != other.checksum:
            found.append("its voxels were changed since it was labelled")
        return tuple(found)


def _times(values: tuple[float, ...]) -> str:
    return " x ".join(f"{value:g}" for value in values)

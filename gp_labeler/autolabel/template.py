"""A template: what is prepared once of a labelled scan, and kept in a small file."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.disk import atomic_file
from gp_core.errors import FileFormatError, GpError
from gp_core.validation import FloatArray
from gp_labeler.autolabel.grey_image import Affine, GreyImage, SampleGrid, sampled, smoothed_for
from gp_labeler.autolabel.head_surface import HeadSurface
from gp_labeler.autolabel.labelled_scan import LabelledScan
from gp_labeler.autolabel.settings import Settings
from gp_labeler.head_pose.bone import (
    COARSER,
    Bone,
    CoarseScan,
    coarse_scan,
    finest_step,
    threshold_candidates,
)
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.volume import Volume

__all__ = ["Region", "Template", "part_of"]

_VERSION = 1
_IDENTITY = Affine(np.eye(3), np.zeros(3))
_FINER_THAN_STEP = 0.75
"""Cubes of voxels over the step at which they are sampled."""


@dataclass(frozen=True, eq=False)
class Region:
    """A part of a head with landmarks close together, such as an ear.

    Parameters
    ----------
    names : tuple of str
        Its landmarks.
    image : GreyImage
        As fine as they are to be found.
    """

    names: tuple[str, ...]
    image: GreyImage


@dataclass(frozen=True, eq=False)
class Template:
    """A labelled head, prepared.

    Parameters
    ----------
    name : str
        Of the specimen.
    key : str
        Of what it was made of; see `key_of`.
    points : mapping of str to (3,) array
        Landmarks, LPS mm in its own scan.
    surface : HeadSurface
    image : GreyImage
        The whole head, coarse.
    regions : tuple of Region
        The parts with landmarks, fine.
    """

    name: str
    key: str
    points: Mapping[str, FloatArray]
    surface: HeadSurface
    image: GreyImage = field(repr=False)
    regions: tuple[Region, ...] = field(repr=False)

    @classmethod
    def of(
        cls, scan: LabelledScan, settings: Settings | None = None, report: Report | None = None
    ) -> Template:
        """Prepare a labelled scan.

        Raises
        ------
        GpError
            The scan cannot be read, or has no bone.
        Cancelled
            The report said so.
        """
        settings, report = settings or Settings(), report or Report()
        volume = scan.load(report)
        report.check()
        _require_inside(scan, volume)
        bone = _bone_of(volume)
        report.check()
        whole_step = max(bone.radius / settings.whole, *volume.spacing)
        margin = settings.margin * bone.radius
        low, high = bone.points.min(axis=0) - margin / 2, bone.points.max(axis=0) + margin / 2
        whole = part_of(volume, whole_step)
        image = sampled(whole, SampleGrid.around(low, high, whole_step), _IDENTITY, bone.threshold)
        fine_step = max(bone.radius / settings.fine, *volume.spacing)
        regions = []
        for names in _clusters(scan.points, settings.reach * bone.radius, settings.fewest):
            report.check()
            own = np.array([scan.points[name] for name in names])
            grid = SampleGrid.around(own.min(axis=0) - margin, own.max(axis=0) + margin, fine_step)
            part = part_of(volume, fine_step, np.stack([grid.origin, grid.high]))
            regions.append(Region(names, sampled(part, grid, _IDENTITY, bone.threshold)))
        key = cls.key_of(scan, settings, volume.checksum)
        return cls(scan.name, key, dict(scan.points), HeadSurface.of(bone), image, tuple(regions))

    @staticmethod
    def key_of(scan: LabelledScan, settings: Settings, checksum: str | None = None) -> str:
        """Return what tells a template from those of other scans, landmarks and settings.

        Parameters
        ----------
        scan : LabelledScan
        settings : Settings
        checksum : str, optional
            Of the scan, which is read where this is not given.
        """
        return f"{scan.key(checksum or scan.load().checksum)}-{settings.key}-{_VERSION}"

    def array(self, names: tuple[str, ...]) -> FloatArray:
        """Return some of the landmarks, (N, 3) LPS mm."""
        return np.array([self.points[name] for name in names])

    def save(self, path: Path) -> None:
        """Write it, all of it or nothing; raises `OSError`."""
        arrays: dict[str, Any] = {
            "version": _VERSION,
            "name": self.name,
            "key": self.key,
            "names": np.array(list(self.points)),
            "points": np.array(list(self.points.values())),
            "surface": self.surface.points.astype(np.float32),
            "centre": self.surface.centre,
            "radius": self.surface.radius,
            "T_index_scan": self.surface.T_index_scan,
            "size": self.surface.size,
            "n_regions": len(self.regions),
            **_packed("whole", self.image),
        }
        for n, region in enumerate(self.regions):
            arrays |= {f"names_{n}": np.array(region.names), **_packed(f"region_{n}", region.image)}
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(path) as draft, draft.open("wb") as file:
            np.savez_compressed(file, **arrays)

    @classmethod
    def load(cls, path: Path) -> Template:
        """Read a template that was saved.

        Raises
        ------
        FileFormatError
            It is damaged, or of another version.
        """
        try:
            with np.load(path, allow_pickle=False) as kept:
                if int(kept["version"]) != _VERSION:
                    raise ValueError("of another version")
                names = [str(name) for name in kept["names"]]
                surface = HeadSurface(
                    kept["surface"].astype(np.float64),
                    kept["centre"],
                    float(kept["radius"]),
                    kept["T_index_scan"],
                    kept["size"].astype(np.intp),
                )
                regions = tuple(
                    Region(tuple(str(name) for name in kept[f"names_{n}"]), _unpacked(kept, f"region_{n}"))
                    for n in range(int(kept["n_regions"]))
                )
                points = dict(zip(names, np.array(kept["points"], dtype=np.float64), strict=True))
                image = _unpacked(kept, "whole")
                return cls(str(kept["name"]), str(kept["key"]), points, surface, image, regions)
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
            raise FileFormatError(f"is not a template ({error})", file=path, remedy="Delete it.") from None


def part_of(volume: Volume, step: float, box: FloatArray | None = None) -> CoarseScan:
    """Return a scan, or the part of it in a (2, 3) box, LPS mm, ready to be sampled at a step.

    Raises
    ------
    GpError
        The box holds none of the scan.
    """
    return smoothed_for(coarse_scan(volume, _FINER_THAN_STEP * step, box), step)


def _require_inside(scan: LabelledScan, volume: Volume) -> None:
    """Raise `GpError` where most landmarks lie outside their scan."""
    outside = int((~volume.contains(scan.array)).sum())
    if 2 * outside > len(scan.points):
        raise GpError(
            f"{outside} of its {len(scan.points)} landmarks lie outside its scan",
            file=scan.path,
            specimen=scan.name,
            remedy="Check that they belong to this scan, and are given in its coordinates.",
        )


def _bone_of(volume: Volume) -> Bone:
    """Return the bone of a scan by itself, at the likeliest threshold."""
    scan = coarse_scan(volume, COARSER * finest_step(volume))
    return Bone.islands(scan, threshold_candidates(scan)[0])[0]


def _clusters(points: Mapping[str, FloatArray], reach: float, fewest: int) -> list[tuple[str, ...]]:
    """Return the names of landmarks that lie within `reach` mm of each other, so many or more together."""
    from scipy.cluster.hierarchy import fcluster, linkage

    names = list(points)
    numbers = fcluster(linkage(np.array(list(points.values())), "complete"), reach, "distance")
    together = [
        tuple(name for name, number in zip(names, numbers, strict=True) if number == n)
        for n in np.unique(numbers)
    ]
    return [group for group in together if len(group) >= fewest]


def _packed(prefix: str, image: GreyImage) -> dict[str, NDArray[Any]]:
    place = np.array([*image.grid.origin, image.grid.step])
    return {f"{prefix}_values": image.packed(), f"{prefix}_place": place}


def _unpacked(kept: Any, prefix: str) -> GreyImage:
    packed, place = kept[f"{prefix}_values"], kept[f"{prefix}_place"]
    nz, ny, nx = packed.shape
    return GreyImage.unpacked(SampleGrid(place[:3], float(place[3]), (nx, ny, nz)), packed)

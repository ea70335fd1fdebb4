"""A real scan, read by another library, and ways to write it that are not ours."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import nibabel
import numpy as np
import pytest
import SimpleITK
import tifffile
from PIL import Image

MOUSE_CT = Path(__file__).resolve().parents[4] / "shared" / "data" / "mouse_ct"
BONE = 25
LPS_FROM_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])


@dataclass(frozen=True, eq=False)
class Scan:
    """Grey values (z, y, x), the affine from (i, j, k) to LPS mm, and landmarks (N, 3) in LPS mm."""

    array: np.ndarray
    affine: np.ndarray
    landmarks: np.ndarray

    @property
    def spacing(self) -> np.ndarray:
        return np.linalg.norm(self.affine[:3, :3], axis=0)

    def values(self, points: np.ndarray) -> np.ndarray:
        """Nearest values at LPS mm, worked out here and not by the code under test."""
        inverse = np.linalg.inv(self.affine)
        i, j, k = np.rint(points @ inverse[:3, :3].T + inverse[:3, 3]).astype(int).T
        return self.array[k, j, i]

    def image(self) -> SimpleITK.Image:
        image = SimpleITK.GetImageFromArray(self.array)
        image.SetSpacing(self.spacing.tolist())
        image.SetOrigin(self.affine[:3, 3].tolist())
        image.SetDirection((self.affine[:3, :3] / self.spacing).ravel().tolist())
        return image

    def crop(self, size: tuple[int, int, int] = (72, 66, 61)) -> Scan:
        """Cut out a box (x, y, z voxels) in the middle of the skull."""
        low = [(n - m) // 2 for n, m in zip(self.array.shape[::-1], size, strict=True)]
        affine = self.affine.copy()
        affine[:3, 3] += affine[:3, :3] @ np.array(low, float)
        (i, j, k), (x, y, z) = low, size
        return Scan(
            np.ascontiguousarray(self.array[k : k + z, j : j + y, i : i + x]), affine, self.landmarks[:0]
        )

    def as_type(self, dtype: str, factor: float = 1.0) -> Scan:
        return Scan((self.array * factor).astype(dtype), self.affine, self.landmarks)


def load_mouse(name: str = "C57BL6_J_") -> Scan:
    path = MOUSE_CT / f"{name}.nii.gz"
    if not path.exists():
        pytest.skip(f"real mouse volumes are not at {MOUSE_CT}")
    return _load(path)


@cache
def _load(path: Path) -> Scan:
    image = nibabel.load(path)
    array = np.ascontiguousarray(np.asarray(image.dataobj).T)
    array.setflags(write=False)
    points = np.empty((0, 3))
    landmarks = path.with_name(path.name.replace(".nii.gz", ".mrk.json"))
    if landmarks.exists():
        markup = json.loads(landmarks.read_text())["markups"][0]
        points = np.array([point["position"] for point in markup["controlPoints"]])
    return Scan(array, LPS_FROM_RAS @ image.affine, points)


def cropped(dtype: str = "uint8", factor: float = 1.0) -> Scan:
    return load_mouse().crop().as_type(dtype, factor)


def write_sitk(scan: Scan, path: Path, *, compress: bool = False) -> Path:
    SimpleITK.WriteImage(scan.image(), str(path), useCompression=compress)
    return path


def write_nifti(scan: Scan, path: Path, **header: object) -> Path:
    image = nibabel.Nifti1Image(scan.array.T, LPS_FROM_RAS @ scan.affine, dtype=scan.array.dtype)
    image.header.set_xyzt_units("mm")
    for name, value in header.items():
        image.header[name] = value
    nibabel.save(image, path)
    return path


def write_tiff_stack(
    scan: Scan, folder: Path, name: str = "slice_{:04d}.tif", first: int = 0, **how: object
) -> Path:
    folder.mkdir(exist_ok=True)
    for n, plane in enumerate(scan.array):
        tifffile.imwrite(folder / name.format(n + first), plane, **how)
    return folder


def write_image_stack(scan: Scan, folder: Path, name: str, first: int = 0, **how: object) -> Path:
    folder.mkdir(exist_ok=True)
    for n, plane in enumerate(scan.array):
        Image.fromarray(plane).save(folder / name.format(n + first), **how)
    return folder

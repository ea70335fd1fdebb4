"""Deformable registration of two images on one grid: greedy, or SimpleITK's demons where it is not installed.

Greedy: Yushkevich et al., "Fast automatic segmentation of hippocampal subfields and medial temporal lobe
subregions in 3 Tesla and 7 Tesla T2-weighted MRI", Alzheimer's & Dementia 12(7), 2016;
https://github.com/pyushkevich/greedy. Demons: Vercauteren et al., "Diffeomorphic demons", NeuroImage 45(1),
2009, https://doi.org/10.1016/j.neuroimage.2008.10.040.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gp_core.errors import GpError

__all__ = [
    "COARSER",
    "ENGINES",
    "RegisterImages",
    "Registration",
    "engine_named",
    "register_demons",
    "register_greedy",
]

Field = NDArray[np.float32]
"""Displacements (nz, ny, nx, 3), mm: from a point of the fixed image to the same place in the moving one."""

COARSER = (
    "registered with SimpleITK's demons, which is less accurate than greedy (pip install 'gp-labeler[auto]')"
)

_PASSES = (("NCC 2x2x2", "1.5vox 0.7vox"), ("NCC 1x1x1", "1.0vox 0.3vox"))
"""What is compared, and how updates and their sum are smoothed: a smooth field, then what it missed."""

_DEMONS_STEPS = (40, 30, 15)


class RegisterImages(Protocol):
    """Registers a moving image to a fixed one on the same grid."""

    def __call__(
        self, fixed: NDArray[np.float32], moving: NDArray[np.float32], step: float, iterations: str
    ) -> Field:
        """Return the displacements, mm.

        Parameters
        ----------
        fixed, moving : (nz, ny, nx) array
        step : float
            mm.
        iterations : str
            From coarse to fine, such as ``60x40x15``; after a space those of a second pass, which starts
            where the first ended and takes up what that has smoothed away.
        """
        ...


class Registration(Protocol):
    """An engine, and how it is stopped."""

    @property
    def name(self) -> str:
        """``greedy`` or ``demons``."""
        ...

    def register(
        self,
        fixed: NDArray[np.float32],
        moving: NDArray[np.float32],
        step: float,
        iterations: str,
        cancel: Callable[[], bool] | None = None,
    ) -> Field:
        """Return the displacements; raises `Cancelled` where `cancel` says so."""
        ...


def register_greedy(
    fixed: NDArray[np.float32], moving: NDArray[np.float32], step: float, iterations: str
) -> Field:
    """Register by greedy with normalised cross-correlation; see `RegisterImages`.

    The interpreter stands still meanwhile: a program with a window calls it in another process.
    """
    field: Field | None = None
    for counts, (metric, smoothing) in zip(iterations.split(), _PASSES, strict=False):
        seen = moving if field is None else _warped(moving, field, step)
        update = _greedy(fixed, seen, step, f"-m {metric} -n {counts} -s {smoothing}")
        field = update if field is None else _composed(field, update, step)
    assert field is not None
    return field


def register_demons(
    fixed: NDArray[np.float32], moving: NDArray[np.float32], step: float, iterations: str
) -> Field:
    """Register by diffeomorphic demons, coarse to fine, with iterations of its own; see `RegisterImages`."""
    sitk = _simple_itk()
    whole, other = _image(fixed, step), _image(moving, step)
    field: Any = None
    for factor, n in zip((4, 2, 1), _DEMONS_STEPS, strict=True):
        a, b = _shrunk(whole, factor, step), _shrunk(other, factor, step)
        demons = sitk.DiffeomorphicDemonsRegistrationFilter()
        demons.SetNumberOfThreads(1)
        demons.SetNumberOfIterations(n)
        demons.SetStandardDeviations(1.0)
        demons.SetSmoothDisplacementField(True)
        if field is None:
            field = demons.Execute(a, b)
        else:
            start = sitk.Cast(sitk.Resample(field, a), sitk.sitkVectorFloat64)
            field = demons.Execute(a, b, start)
    return np.asarray(sitk.GetArrayFromImage(field), dtype=np.float32)


ENGINES: dict[str, RegisterImages] = {"greedy": register_greedy, "demons": register_demons}


def engine_named(name: str = "auto") -> str:
    """Return the engine that is used.

    Parameters
    ----------
    name : {"auto", "greedy", "demons"}
        auto: greedy where it is installed.

    Raises
    ------
    GpError
        It is unknown, or not installed.
    """
    if name not in ("auto", *ENGINES):
        raise GpError(f"the engine must be auto, {' or '.join(ENGINES)}, got {name!r:.40}")
    has_greedy = find_spec("picsl_greedy") is not None
    if name == "auto":
        return "greedy" if has_greedy else "demons"
    if name == "greedy" and not has_greedy:
        raise GpError(
            "picsl_greedy is not installed", remedy="Install it with: pip install 'gp-labeler[auto]'"
        )
    return name


def _greedy(fixed: NDArray[np.float32], moving: NDArray[np.float32], step: float, options: str) -> Field:
    from picsl_greedy import Greedy3D

    greedy = Greedy3D()
    images = {name: _image(values, step) for name, values in (("fixed", fixed), ("moving", moving))}
    greedy.execute(
        f"-i fixed moving {options} -threads 1 -V 0 -wp 0 -o field",
        out=io.StringIO(),
        err=io.StringIO(),
        **images,
        field=None,
    )
    return np.asarray(_simple_itk().GetArrayFromImage(greedy["field"]), dtype=np.float32)


def _warped(values: NDArray[np.float32], field: Field, step: float) -> NDArray[np.float32]:
    """Return an image [z, y, x] as it is seen from the points that a field moves into it."""
    from scipy.ndimage import map_coordinates

    places = np.indices(values.shape, dtype=np.float32)
    places += np.moveaxis(field[..., ::-1], -1, 0) / np.float32(step)
    return np.asarray(map_coordinates(values, places, order=1, mode="nearest", output=np.float32))


def _composed(first: Field, then: Field, step: float) -> Field:
    """Return the field that moves a point by the later one, and from there by the first one."""
    parts = [_warped(np.ascontiguousarray(first[..., c]), then, step) for c in range(3)]
    return np.asarray(then + np.stack(parts, axis=-1), dtype=np.float32)


def _simple_itk() -> Any:
    import SimpleITK  # takes a while: not before it is needed

    return SimpleITK


def _image(values: NDArray[np.float32], step: float) -> Any:
    image = _simple_itk().GetImageFromArray(np.ascontiguousarray(values, dtype=np.float32))
    image.SetSpacing([step] * 3)
    return image


def _shrunk(image: Any, factor: int, step: float) -> Any:
    if factor == 1:
        return image
    sitk = _simple_itk()
    return sitk.Shrink(sitk.SmoothingRecursiveGaussian(image, 0.5 * factor * step), [factor] * 3)

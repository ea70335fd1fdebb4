"""Scans, surfaces, landmarks, atlases and poses as pyvista datasets, for whoever draws or measures them.

`to_pyvista` takes them all. It stands here, not in `gp_core`, which imports no VTK.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gp_core import Atlas, CochleaPose, GpError, LandmarkSet, Specimen
from gp_core.validation import FloatArray
from gp_labeler.imaging.mean_cochlea import cochlea_tubes
from gp_labeler.imaging.mesh import Surface
from gp_labeler.imaging.volume import Volume

if TYPE_CHECKING:
    import pyvista as pv

__all__ = ["ellipsoid", "to_pyvista"]

_AXIS_MM = 5.0
_WIDEST = 1.2  # rad: a wider cone would not fit into any picture


@singledispatch
def to_pyvista(data: object) -> Any:
    """Return a scan, surface, set of landmarks, specimen, atlas or pose as a pyvista dataset.

    Parameters
    ----------
    data : Volume, Surface, LandmarkSet, Specimen, Atlas or CochleaPose
        Lengths stay mm, and everything stays in its frame, which ``field_data["frame"]`` names.

    Returns
    -------
    pyvista.ImageData, pyvista.PolyData or pyvista.MultiBlock
        - A `Volume`: ``ImageData`` with its direction, the point data ``values`` sharing the voxels' memory.
        - A `Surface`: its ``mesh``.
        - A `LandmarkSet`: blocks ``placed`` and ``suggested``, points with ``code``. Only what is placed is
          an observation.
        - A `Specimen`: a block for each side, ``L`` and ``R``.
        - An `Atlas`: blocks ``mean``, points with ``code``, and ``regions``, of 95 % of all animals, by code.
        - A `CochleaPose`: blocks ``origin``, ``axis``, ``region_95``, ``cone_95``, ``duct`` and ``modiolus``,
          the last two those of the mean cochlea.

    Raises
    ------
    GpError
        Anything else.

    Examples
    --------
    >>> import gp_core
    >>> to_pyvista(gp_core.Atlas.published()).keys()
    ['mean', 'regions']
    """
    raise GpError(
        f"no pyvista dataset can be made of {type(data).__name__}",
        remedy="Give a Volume, Surface, LandmarkSet, Specimen, Atlas or CochleaPose.",
    )


@to_pyvista.register(Volume)
def _(data: Volume) -> pv.ImageData:
    return data.to_pyvista()


@to_pyvista.register(Surface)
def _(data: Surface) -> pv.PolyData:
    return data.mesh


@to_pyvista.register(LandmarkSet)
def _(data: LandmarkSet) -> pv.MultiBlock:
    suggested = [data.suggested[code].position for code in data.suggested]
    blocks = {
        "placed": _points(data.array(data.placed), data.placed),
        "suggested": _points(suggested, tuple(data.suggested)),
    }
    return _named(blocks, frame=data.frame, side=data.side.value)


@to_pyvista.register(Specimen)
def _(data: Specimen) -> pv.MultiBlock:
    frames = {landmarks.frame for landmarks in data.sides.values()}
    blocks = {side.value: to_pyvista(landmarks) for side, landmarks in data.sides.items()}
    return _named(blocks, frame=" ".join(sorted(frames)), name=data.name)


@to_pyvista.register(Atlas)
def _(data: Atlas) -> pv.MultiBlock:
    parts = [data.scatter[3 * n : 3 * n + 3, 3 * n : 3 * n + 3] for n in range(len(data.codes))]
    each = zip(data.codes, data.mean, parts, strict=True)
    regions = {code: ellipsoid(mean, part) for code, mean, part in each}
    blocks = {"mean": _points(data.mean, data.codes), "regions": _named(regions, frame="atlas")}
    return _named(blocks, frame="atlas", name=data.name)


@to_pyvista.register(CochleaPose)
def _(data: CochleaPose) -> pv.MultiBlock:
    import pyvista as pv

    duct, modiolus = (tube.transform(data.transform, inplace=False) for tube in cochlea_tubes(data.side))
    cone = pv.Cone(
        center=data.origin + 0.5 * _AXIS_MM * data.axis,
        direction=-data.axis,
        height=_AXIS_MM,
        radius=_AXIS_MM * float(np.tan(min(data.cone_95, _WIDEST))),
        resolution=48,
        capping=False,
    )
    blocks = {
        "origin": _points([data.origin], ("CO",)),
        "axis": pv.Line(data.origin, data.origin + _AXIS_MM * data.axis),
        "region_95": ellipsoid(data.origin, data.covariance[:3, :3]),
        "cone_95": cone,
        "duct": duct,
        "modiolus": modiolus,
    }
    return _named(
        blocks,
        frame=data.transform_to_touches.dst,
        side=data.side.value,
        method=data.method,
        atlas=data.atlas,
        radius_95_mm=data.radius_95,
        cone_95_deg=float(np.degrees(data.cone_95)),
    )


def ellipsoid(centre: FloatArray, covariance: FloatArray) -> pv.PolyData:
    """Return the surface within which 95 % of a Gaussian lie.

    Parameters
    ----------
    centre : (3,) array, mm
    covariance : (3, 3) array, mm^2
    """
    import pyvista as pv
    from scipy.special import chdtri

    values, axes = np.linalg.eigh(covariance)
    axes[:, 0] *= np.sign(np.linalg.det(axes))  # a mirrored ball would turn its faces inward
    place = np.eye(4)
    place[:3, :3] = np.sqrt(chdtri(3, 0.05)) * axes * np.sqrt(values.clip(1e-12))
    place[:3, 3] = centre
    ball = pv.Sphere(radius=1.0, theta_resolution=40, phi_resolution=24)
    moved: pv.PolyData = ball.transform(place, inplace=False)
    return moved


def _points(positions: Sequence[Any] | NDArray[Any], codes: Sequence[str]) -> pv.PolyData:
    import pyvista as pv

    if not codes:
        return pv.PolyData()
    points = pv.PolyData(np.array(positions, dtype=np.float64))
    points["code"] = np.array(codes)
    return points


def _named(blocks: dict[str, Any], **facts: object) -> pv.MultiBlock:
    import pyvista as pv

    whole = pv.MultiBlock(blocks)
    for name, fact in facts.items():
        whole.add_field_data([fact], name)
    return whole
